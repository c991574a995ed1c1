/* get: shows a resource, or saves its JSON or its data. */
#include <stdlib.h>
#include <string.h>

#include "commands.h"
#include "prefix.h"
#include "report.h"
#include "resource.h"
#include "terminal.h"
#include "text.h"

/* What --part names: the data of the resources of one collection. */
typedef struct part_kind {
  const char *name, *collection, *tail, *endings;
} part_kind;

static const part_kind parts[] = {{"file", "meshes", "/file", NULL},
                                  {"asset", "supermeshes", "/asset.glb", "glb"},
                                  {"sphere", "embeddings", "/sphere.ply", "ply"}};
enum { PARTS = sizeof parts / sizeof parts[0] };

static const part_kind *find_part(const char *name) {
  for (int i = 0; name && i < PARTS; i++) {
    if (!strcmp(parts[i].name, name)) {
      return &parts[i];
    }
  }
  return NULL;
}

/* The endings of files that fit what lies at a path or URL; NULL: any. */
static const char *endings_of(const char *path) {
  static const struct {
    const char *tail, *endings;
  } tails[] = {{".glb", "glb"},    {".ply", "ply"},  {"/places", "bin"}, {"/file", NULL}, {"/events", NULL},
               {"/metrics", NULL}, {"/livez", NULL}, {"/readyz", NULL},  {"/docs", NULL}};
  size_t length = strcspn(path, "?");
  for (size_t i = 0; i < sizeof tails / sizeof tails[0]; i++) {
    size_t size = strlen(tails[i].tail);
    if (length >= size && !strncmp(path + length - size, tails[i].tail, size)) {
      return tails[i].endings;
    }
  }
  return "json";
}

/* Whether a path leads into a collection; in a path of the user's it may follow a prefix of a proxy. */
static int is_in(const char *path, const char *collection) {
  char *folder = cli_text("/v1/%s/", collection);
  int found = strstr(path, folder) != NULL;
  free(folder);
  return found;
}

/* Refuses a resource of another kind than the part is of: the daemon would only say that it finds nothing. */
static int check_kind(const cli *c, const part_kind *part, const char *path) {
  if (is_in(path, part->collection)) {
    return CLI_DONE;
  }
  for (int i = 0; i < PARTS; i++) {
    if (is_in(path, parts[i].collection)) {
      cli_error(c, "%s: --part %s is for %s; this is one of the %s, whose data is --part %s", c->args.operands[0],
                part->name, part->collection, parts[i].collection, parts[i].name);
      return CLI_REFUSED;
    }
  }
  cli_error(c, "%s: --part %s is for %s, and this is none", c->args.operands[0], part->name, part->collection);
  return CLI_REFUSED;
}

static int get_part(cli *c, const part_kind *part, const char *output) {
  const char *operand = c->args.operands[0];
  char *base = NULL;
  cli_reply reply = {0};
  int named = strchr(operand, '/') || cli_is_prefix(operand);
  int rc = cli_can_write(c, output, part->endings);
  if (rc == CLI_DONE) {
    rc = named ? cli_locate(c, part->collection, operand, &base) : cli_find(c, operand, &base, &reply);
  }
  if (rc == CLI_DONE) {
    rc = check_kind(c, part, base);
  }
  if (rc == CLI_DONE) {
    char *whole = cli_text("%s%s", base, part->tail), *path = cli_asset_path(c, whole);
    rc = cli_download(c, path, output);
    free(whole);
    free(path);
  }
  cli_reply_free(&reply);
  free(base);
  return rc;
}

/* Saves what lies at the operand, whose name fits these endings. */
static int save(cli *c, const char *endings, const char *output) {
  const char *operand = c->args.operands[0];
  char *path = NULL;
  cli_reply reply = {0};
  if (!strchr(operand, '/') && !cli_name_fits(output, endings)) {
    char *base = cli_base_name(output);
    cli_error(c,
              "%s: without --part, get writes JSON, into %s.json; add --part asset to get the GLB of a supermesh, "
              "--part sphere for the PLY of an embedding, --part file for the file of a mesh",
              output, base);
    free(base);
    return CLI_USAGE;
  }
  int rc = cli_can_write(c, output, endings);
  if (rc == CLI_DONE) {
    rc = strchr(operand, '/') ? cli_locate(c, "", operand, &path) : cli_find(c, operand, &path, &reply);
  }
  if (rc == CLI_DONE) {
    rc = cli_download(c, path, output);
  }
  cli_reply_free(&reply);
  free(path);
  return rc;
}

static void print_any(const char *path, const cli_reply *reply) {
  if (strstr(path, "/v1/meshes/")) {
    cli_print_mesh(reply->json);
  } else if (strstr(path, "/v1/embeddings/")) {
    cli_print_embedding(reply->json);
  } else if (strstr(path, "/v1/supermeshes/")) {
    cli_print_supermesh(reply->json);
  } else if (strstr(path, "/v1/jobs/")) {
    cli_print_job(reply->json);
  }
}

static int show(cli *c) {
  char *path = NULL;
  cli_reply reply = {0};
  int rc = cli_find(c, c->args.operands[0], &path, &reply);
  if (rc == CLI_DONE && (c->json || !reply.json)) {
    puts(reply.body ? reply.body : "");
  } else if (rc == CLI_DONE) {
    print_any(path, &reply);
  }
  cli_reply_free(&reply);
  free(path);
  return rc;
}

int cli_run_get(cli *c) {
  const char *name = c->args.value[OPT_PART], *output = c->args.value[OPT_OUTPUT];
  const part_kind *part = find_part(name);
  if (!cli_check_profile(c)) {
    return CLI_USAGE;
  }
  if (c->args.value[OPT_PROFILE] && (!name || strcmp(name, "asset") != 0)) {
    cli_error(c, "--profile needs --part asset");
    return CLI_USAGE;
  }
  if (name && !part) {
    cli_error(c, "--part takes file (of a mesh), asset (of a supermesh) or sphere (of an embedding)");
    return CLI_USAGE;
  }
  if (part) {
    return get_part(c, part, output ? output : "-");
  }
  const char *endings = endings_of(c->args.operands[0]);
  int is_data = !endings || strcmp(endings, "json") != 0;
  return output || is_data ? save(c, endings, output ? output : "-") : show(c);
}
