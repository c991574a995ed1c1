#include "problem.h"

#include <stdlib.h>
#include <string.h>

#include "terminal.h"
#include "text.h"

enum { FACT_LENGTH_MOST = 160 };

const char *cli_problem_type(const cJSON *problem) {
  const char *type = cli_string(problem, "type", "about:blank"), *slash = strrchr(type, '/');
  return slash ? slash + 1 : type;
}

static int is_standard(const char *name) {
  static const char *const names[] = {"type", "title", "status", "detail", "instance"};
  for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
    if (!strcmp(name, names[i])) {
      return 1;
    }
  }
  return 0;
}

static void print_facts(const cJSON *problem) {
  for (const cJSON *item = problem->child; item; item = item->next) {
    if (!item->string || is_standard(item->string)) {
      continue;
    }
    char *text = cJSON_PrintUnformatted(item);
    if (!text) {
      continue;
    }
    if (strlen(text) > FACT_LENGTH_MOST) {
      strcpy(text + FACT_LENGTH_MOST - 4, " …");
    }
    fprintf(stderr, "  %s: %s\n", item->string, text);
    free(text);
  }
}

int cli_problem(cli *c, const char *subject, const cJSON *problem) {
  cli_bar_end(c);
  if (c->json) {
    char *text = cJSON_Print(problem);
    fprintf(stderr, "%s\n", text ? text : "{}");
    free(text);
    return CLI_REFUSED;
  }
  cli_error(c, "%s%s%s: %s", subject ? subject : "", subject ? ": " : "", cli_problem_type(problem),
            cli_string(problem, "detail", cli_string(problem, "title", "refused")));
  print_facts(problem);
  return CLI_REFUSED;
}

int cli_refused(cli *c, const char *subject, const cli_reply *reply) {
  cli_bar_end(c);
  if (cJSON_IsObject(reply->json)) {
    return cli_problem(c, subject, reply->json);
  }
  cli_error(c, "%s%sthe daemon returned status %ld", subject ? subject : "", subject ? ": " : "", reply->status);
  return CLI_REFUSED;
}

const char *cli_advice(const char *type) {
  static const struct {
    const char *type, *advice;
  } list[] = {
      {"not-closed",
       "The surface has holes. Close them in the program that made the mesh, or upload with "
       "--repair fill_holes, which covers each hole with a patch."},
      {"not-manifold",
       "Some edges have more than two faces, or faces meet only at a point. Remove inner walls and "
       "duplicate faces ('Select Non Manifold' in Blender), or upload with --repair split_nonmanifold, which splits "
       "the "
       "surface there."},
      {"not-orientable",
       "The faces cannot all point outward. If the surface has only one side, cut it at the edge above and close it. "
       "If --repair none left faces reversed, recalculate the normals, or upload with --repair safe."},
      {"not-connected",
       "The file holds several pieces. Join them into one closed surface, upload each piece by itself, or "
       "keep one: --repair largest_component keeps the largest, --take-part another."},
      {"not-genus-zero",
       "The surface has handles, like a ring or a cup. Only surfaces without handles can be embedded on the "
       "sphere: cut each handle and close both ends, or let --repair close_handles do so with small ones."},
      {"degenerate",
       "Too few triangles remain after repair, or the mesh is tiny or far from the origin. Check that you exported "
       "the right object; scale it or move it to the origin."},
      {"not-finite",
       "Some coordinates are not finite numbers or exceed 1e30. Export the mesh again, or scale it down."},
      {"malformed-mesh",
       "The file is damaged or truncated at the reported position, or holds no surface. Export or download it again; "
       "of a cloud of points, make a surface first."},
      {"unknown-format", "The supported formats are OBJ, OFF, PLY, STL, 3MF, glTF and GLB."},
      {"too-large", "The mesh is larger than the daemon accepts. Decimate it first, or raise the daemon's limits."},
  };
  for (size_t i = 0; i < sizeof list / sizeof list[0]; i++) {
    if (!strcmp(list[i].type, type)) {
      return list[i].advice;
    }
  }
  return NULL;
}
