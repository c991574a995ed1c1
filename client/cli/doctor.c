/* doctor: checks a mesh by uploading it. Where it is refused, lists the faults, allows the repair that mends them and
 * uploads it again, which finds the next faults, until the daemon takes it or no repair is left. */
#include <stdlib.h>
#include <string.h>

#include "commands.h"
#include "http.h"
#include "mesh.h"
#include "problem.h"
#include "report.h"
#include "text.h"

/* Deletes an uploaded mesh unless the daemon already held it before the upload. */
static void forget(cli *c, const cli_reply *reply) {
  char *path = cli_text("/v1/meshes/%s", cli_string(reply->json, "id", ""));
  cli_request request = {.method = "DELETE", .path = path};
  cli_reply gone = {0};
  if (reply->status == 201 && cli_send(c, &request, &gone) == CLI_DONE) {
    cli_reply_free(&gone);
  }
  free(path);
}

/* A repair that keeps less than this part of the triangles makes another shape. */
static const double KEPT_LEAST = 0.5;

/* The loops that close_handles cuts by default, and the longest that it can be told to, relative to the diagonal. */
static const double HANDLE_SIZE = 0.05, HANDLE_SIZE_MOST = 10;

/* A cut can lengthen other loops, and a refusal may leave some out, so that a longer one is needed; by this factor more
 * than the longest on the list. The same margin and number of attempts as in the studio (actions/shapes.ts). */
static const double HANDLE_MARGIN = 1.01;
enum { HANDLE_ROUNDS = 8 };

/* The stronger repairs, by the order in which the daemon makes them. */
enum { SPLIT, LARGEST, FILL, CLOSE, REPAIRS };
static const char *const REPAIR_NAMES[REPAIRS] = {"split_nonmanifold", "largest_component", "fill_holes",
                                                  "close_handles"};

typedef struct course { /* of treatment */
  int allowed[REPAIRS];
  double size; /* of handles; 0: the daemon's default */
  int rounds;  /* with a size of handles */
} course;

/* Both may be NULL, and the caller frees them. */
static void texts_of(const course *now, char **list, char **size) {
  *list = NULL;
  for (int i = 0; i < REPAIRS; i++) {
    if (now->allowed[i]) {
      char *longer = cli_text("%s%s%s", *list ? *list : "", *list ? "," : "", REPAIR_NAMES[i]);
      free(*list);
      *list = longer;
    }
  }
  *size = now->size > 0 ? cli_text("%.3g", now->size) : NULL;
}

static int upload(cli *c, const char *path, const course *now, cli_reply *reply) {
  char *list, *size;
  texts_of(now, &list, &size);
  int rc = cli_upload(c, path, NULL, &(cli_repairs){.list = list, .handle_size = size}, reply);
  free(list);
  free(size);
  return rc;
}

/* Lists the pieces, which --take-part names, or the loops around the handles. */
static void list_faults(const cJSON *problem) {
  const cJSON *item, *lengths = cJSON_GetObjectItemCaseSensitive(problem, "loop_lengths_relative");
  cJSON_ArrayForEach(item, cJSON_GetObjectItemCaseSensitive(problem, "parts")) {
    char triangles[32];
    cli_count(cli_number(item, "triangles"), triangles);
    printf("  part %.0f: %s triangle%s  %s\n", cli_number(item, "part"), triangles, strcmp(triangles, "1") ? "s" : "",
           cli_string(item, "name", ""));
  }
  const cJSON *length = lengths ? lengths->child : NULL;
  cJSON_ArrayForEach(item, cJSON_GetObjectItemCaseSensitive(problem, "loops")) {
    printf("  handle: a loop of %d vertices, %.2g of the diagonal, at vertex %.0f\n", cJSON_GetArraySize(item),
           cJSON_GetNumberValue(length), cJSON_GetNumberValue(cJSON_GetArrayItem(item, 0)));
    length = length ? length->next : NULL;
  }
  if (cJSON_HasObjectItem(problem, "loops_left_out")) {
    char more[32];
    cli_count(cli_number(problem, "loops_left_out"), more);
    printf("  and %s more\n", more);
  }
}

/* The places of holes and of elements that are not manifold, which the first refusal has on standard error. */
static void list_places(const cJSON *problem) {
  static const struct {
    const char *member, *title, *count;
  } lists[] = {{"boundary_edges", "open edges", "boundary_edge_count"},
               {"edges", "edges", "edge_count"},
               {"vertices", "vertices", "vertex_count"}};
  enum { SHOWN = 8 };
  for (size_t i = 0; i < sizeof lists / sizeof lists[0]; i++) {
    const cJSON *items = cJSON_GetObjectItemCaseSensitive(problem, lists[i].member), *item;
    int shown = 0;
    if (cJSON_GetArraySize(items) == 0) {
      continue;
    }
    printf("  %s:", lists[i].title);
    cJSON_ArrayForEach(item, items) {
      if (shown++ < SHOWN) {
        char *text = cJSON_PrintUnformatted(item);
        printf(" %s", text ? text : "");
        free(text);
      }
    }
    double more = cli_number(problem, lists[i].count) - SHOWN;
    if (more > 0) {
      char count[32];
      cli_count(more, count);
      printf(" and %s more", count);
    }
    putchar('\n');
  }
}

static double longest_loop(const cJSON *problem) {
  const cJSON *length;
  double most = 0;
  cJSON_ArrayForEach(length, cJSON_GetObjectItemCaseSensitive(problem, "loop_lengths_relative")) {
    most = length->valuedouble > most ? length->valuedouble : most;
  }
  return most;
}

/* Allows longer loops than before. Returns 0 if that is not possible. */
static int allow_handles(course *now, double longest) {
  double before = now->size > 0 ? now->size : now->allowed[CLOSE] ? HANDLE_SIZE : 0;
  if (longest <= before || HANDLE_MARGIN * longest > HANDLE_SIZE_MOST || now->rounds++ == HANDLE_ROUNDS) {
    return 0;
  }
  now->allowed[CLOSE] = 1;
  now->size = longest > HANDLE_SIZE ? HANDLE_MARGIN * longest : 0;
  return 1;
}

/* Allows what mends a refusal. Returns 0 if nothing is left to try. */
static int allow_more(course *now, const cJSON *problem) {
  static const struct {
    const char *type;
    int repair[2]; /* in this order */
  } mends[] = {
      {"not-manifold", {SPLIT, LARGEST}},
      {"not-orientable", {LARGEST, LARGEST}}, /* a smaller piece may be the one that has only one side */
      {"not-closed", {FILL, LARGEST}},
      {"not-connected", {LARGEST, LARGEST}},
  };
  const char *type = cli_problem_type(problem);
  if (!strcmp(type, "not-genus-zero")) {
    return allow_handles(now, longest_loop(problem));
  }
  for (size_t i = 0; i < sizeof mends / sizeof mends[0]; i++) {
    for (int k = 0; k < 2 && !strcmp(mends[i].type, type); k++) {
      if (!now->allowed[mends[i].repair[k]]) {
        now->allowed[mends[i].repair[k]] = 1;
        return 1;
      }
    }
  }
  return 0;
}

/* Forbids what is not necessary: the faults may be on pieces that are left out. reply: of the upload that was accepted,
 * and then of the last one that is. */
static void forbid_surplus(cli *c, const char *path, course *now, cli_reply *reply) {
  for (int i = 0; i < REPAIRS && now->allowed[LARGEST]; i++) {
    course fewer = *now;
    cli_reply other;
    if (i == LARGEST || i == CLOSE || !now->allowed[i]) {
      continue;
    }
    fewer.allowed[i] = 0;
    if (upload(c, path, &fewer, &other) == CLI_DONE && cli_ok(&other)) {
      cli_reply unused = *reply;
      *reply = other;
      other = unused;
      *now = fewer;
      forget(c, &other);
    }
    cli_reply_free(&other);
  }
}

/* The area of the patches over closed handles, as a fraction of the area of the surface. */
static double patched_area(const cJSON *mesh) {
  const cJSON *repair, *bounds = cJSON_GetObjectItemCaseSensitive(mesh, "bounds");
  const cJSON *min = cJSON_GetObjectItemCaseSensitive(bounds, "min"),
              *max = cJSON_GetObjectItemCaseSensitive(bounds, "max");
  double square = 0, area = 0;
  for (int k = 0; k < 3; k++) {
    double side = cJSON_GetNumberValue(cJSON_GetArrayItem(max, k)) - cJSON_GetNumberValue(cJSON_GetArrayItem(min, k));
    square += side * side;
  }
  cJSON_ArrayForEach(repair, cJSON_GetObjectItemCaseSensitive(mesh, "repairs")) {
    area += cJSON_HasObjectItem(repair, "loop") ? cli_number(repair, "area_relative") : 0;
  }
  return area * square / cli_number(mesh, "area");
}

/* Says what the repairs leave of the mesh, and what they change. */
static void print_cure(const cJSON *mesh, const char *path, const course *now) {
  double left = cli_number(mesh, "triangles"), all = cli_number(mesh, "file_triangles"), kept = left / all;
  char some[32], whole[32], *list, *size;
  texts_of(now, &list, &size);
  cli_count(left, some);
  cli_count(all, whole);
  if (now->allowed[LARGEST] && kept < KEPT_LEAST) {
    printf("  --repair %s keeps only %s of %s triangles (%.0f %%): join the pieces instead, or send them one by one.\n",
           list, some, whole, 100 * kept);
  } else {
    printf("  helps: orbmorph upload --repair %s%s%s %s\n", list, size ? " --handle-size " : "", size ? size : "",
           path);
    printf("  left: %s triangles; the file has %s\n", some, whole);
    if (now->allowed[CLOSE]) {
      printf("  new: the patches over the handles are %.2g %% of the area\n", 100 * patched_area(mesh));
    }
    cli_print_repairs(mesh);
  }
  free(list);
  free(size);
}

/* Prints a refusal after the first, which is what the daemon finds once the repairs have mended the one before.
 * again: of the same kind as before; then its lists would repeat those. */
static void print_next(const cJSON *problem, const course *now, int again) {
  char *list, *size;
  texts_of(now, &list, &size);
  printf("  with --repair %s%s%s: %s: %s\n", list, size ? " --handle-size " : "", size ? size : "",
         cli_problem_type(problem), cli_string(problem, "detail", ""));
  if (!again) {
    list_places(problem);
    list_faults(problem);
  }
  free(list);
  free(size);
}

/* Whether there are repairs for refusals of a kind, though none may help. */
static int is_mendable(const char *type) {
  static const char *const types[] = {"not-manifold", "not-orientable", "not-closed", "not-connected",
                                      "not-genus-zero"};
  for (size_t i = 0; i < sizeof types / sizeof types[0]; i++) {
    if (!strcmp(types[i], type)) {
      return 1;
    }
  }
  return 0;
}

/* Uploads a refused file again and again, each time with what mends the last refusal. */
static void treat(cli *c, const char *path, const cJSON *first) {
  course now = {0};
  cli_reply reply = {0};
  char *before = cli_text("%s", cli_problem_type(first));
  const cJSON *problem = first;
  int rc = CLI_DONE;
  while (rc == CLI_DONE && problem && allow_more(&now, problem)) {
    cli_reply_free(&reply);
    rc = upload(c, path, &now, &reply);
    problem = NULL;
    if (rc == CLI_DONE && cli_ok(&reply)) {
      forbid_surplus(c, path, &now, &reply);
      print_cure(reply.json, path, &now);
      forget(c, &reply);
    } else if (rc == CLI_DONE && cJSON_IsObject(reply.json)) {
      problem = reply.json;
      print_next(problem, &now, !strcmp(before, cli_problem_type(problem)));
      free(before);
      before = cli_text("%s", cli_problem_type(problem));
    }
  }
  if (problem && is_mendable(cli_problem_type(first))) {
    printf("  None of the daemon's repairs fixes this mesh.\n");
  }
  free(before);
  cli_reply_free(&reply);
}

static int examine(cli *c, const char *path) {
  static const cli_repairs none = {0};
  cli_reply reply;
  int rc = cli_upload(c, path, NULL, &none, &reply);
  if (rc != CLI_DONE) {
    cli_reply_free(&reply);
    return rc;
  }
  if (c->json && reply.body) {
    puts(reply.body);
    rc = cli_ok(&reply) ? CLI_DONE : CLI_REFUSED;
    if (cli_ok(&reply)) {
      forget(c, &reply);
    }
  } else if (cli_ok(&reply)) {
    char triangles[32];
    cli_count(cli_number(reply.json, "triangles"), triangles);
    printf("%s: healthy: closed, in one piece, genus 0, %s triangles\n", path, triangles);
    cli_print_repairs(reply.json);
    forget(c, &reply);
  } else {
    fflush(stdout);
    rc = cli_refused(c, path, &reply);
    const char *type = reply.json ? cli_problem_type(reply.json) : "", *advice = cli_advice(type);
    if (advice) {
      printf("  %s\n", advice);
    }
    if (reply.json) {
      list_faults(reply.json);
      treat(c, path, reply.json);
    }
  }
  cli_reply_free(&reply);
  return rc;
}

int cli_run_doctor(cli *c) {
  int worst = CLI_DONE;
  for (int i = 0; i < c->args.operand_count; i++) {
    int rc = examine(c, c->args.operands[i]);
    if (rc == CLI_UNREACHABLE) {
      return rc;
    }
    worst = rc > worst ? rc : worst;
  }
  return worst;
}
