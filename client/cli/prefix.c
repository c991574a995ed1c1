#include "prefix.h"

#include <stdlib.h>
#include <string.h>

#include "problem.h"
#include "terminal.h"
#include "text.h"

enum {
  DIGITS_LEAST = 4,
  ID_DIGITS = 64,
  JOB_DIGITS = 32,
  CANDIDATES = 8, /* of each collection; more are only counted as "…" */
};

int cli_is_prefix(const char *text) {
  size_t length = strlen(text);
  return length >= DIGITS_LEAST && length < ID_DIGITS && length != JOB_DIGITS &&
         strspn(text, "0123456789abcdef") == length;
}

/* The line of a candidate in the message. The caller frees it. */
static char *describe(const char *collection, const cJSON *item) {
  const char *id = cli_string(item, "id", "?");
  if (!strcmp(collection, "meshes")) {
    return cli_text("%s  mesh %s", id, cli_string(item, "name", ""));
  }
  if (!strcmp(collection, "embeddings")) {
    return cli_text("%s  embedding of mesh %.12s", id, cli_string(item, "mesh", ""));
  }
  if (!strcmp(collection, "jobs")) {
    return cli_text("%s  job, %s", id, cli_string(item, "state", ""));
  }
  char *line = cli_text("%s  supermesh of", id);
  const cJSON *shape;
  cJSON_ArrayForEach(shape, cJSON_GetObjectItemCaseSensitive(item, "shapes")) {
    char *longer = cli_text("%s %s", line, cli_string(shape, "name", "?"));
    free(line);
    line = longer;
  }
  return line;
}

/* The entries of one collection that match: counts them, and appends their lines. */
static int gather(cli *c, const char *collection, const char *digits, int *count, char **path, char **lines) {
  char *target = cli_text("/v1/%s?limit=%d&id_prefix=%s%s", collection, CANDIDATES, digits,
                          strcmp(collection, "supermeshes") ? "" : "&view=summary");
  cli_reply reply = {0};
  int rc = cli_get(c, target, &reply);
  if (rc == CLI_DONE && !cli_ok(&reply)) {
    rc = cli_refused(c, digits, &reply);
  }
  const cJSON *item, *list = rc == CLI_DONE ? cJSON_GetObjectItemCaseSensitive(reply.json, collection) : NULL;
  cJSON_ArrayForEach(item, list) {
    char *line = describe(collection, item), *longer = cli_text("%s\n  %s", *lines, line);
    free(line);
    free(*lines);
    free(*path);
    *lines = longer;
    *path = cli_text("/v1/%s/%s", collection, cli_string(item, "id", ""));
    ++*count;
  }
  if (rc == CLI_DONE && cli_string(reply.json, "next_page_token", NULL)) {
    char *longer = cli_text("%s\n  …", *lines);
    free(*lines);
    *lines = longer;
  }
  free(target);
  cli_reply_free(&reply);
  return rc;
}

int cli_resolve(cli *c, const char *digits, const char *const *collections, char **path) {
  const char *only = collections[1] ? NULL : collections[0];
  char *lines = cli_text("%s", "");
  int count = 0, rc = CLI_DONE;
  *path = NULL;
  for (; *collections && rc == CLI_DONE; collections++) {
    rc = gather(c, *collections, digits, &count, path, &lines);
  }
  if (rc == CLI_DONE && count == 0) {
    cli_error(c, "%s: not-found: no id%s%s begins with these digits; 'orbmorph ls%s%s' lists the ids", digits,
              only ? " among the " : "", only ? only : "", only ? " " : "", only ? only : "");
    rc = CLI_REFUSED;
  } else if (rc == CLI_DONE && count > 1) {
    cli_error(c, "%s: several ids begin with these digits; give more:%s", digits, lines);
    rc = CLI_REFUSED;
  }
  if (rc != CLI_DONE) {
    free(*path);
    *path = NULL;
  }
  free(lines);
  return rc;
}
