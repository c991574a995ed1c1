/* doctor: checks a mesh by uploading it, tries the stronger repairs and prints the one that helps. */
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

/* Says what a repair would leave of the mesh. Returns whether that is most of it. */
static int leaves_most(const cJSON *mesh, const char *path, const char *repair) {
  double left = cli_number(mesh, "triangles"), all = cli_number(mesh, "file_triangles"), kept = left / all;
  int removes = strstr(repair, "largest_component") != NULL;
  char some[32], whole[32];
  cli_count(left, some);
  cli_count(all, whole);
  if (removes && kept < KEPT_LEAST) {
    printf("  --repair %s keeps only %s of %s triangles (%.0f %%): join the pieces instead, or send them one by one.\n",
           repair, some, whole, 100 * kept);
    return 0;
  }
  printf("  helps: orbmorph upload --repair %s %s\n", repair, path);
  printf("  left: %s triangles; the file has %s\n", some, whole);
  return 1;
}

/* Uploads the file with a repair. Returns 1 and prints the command if the daemon accepts the mesh. */
static int try_repair(cli *c, const char *path, const char *repair) {
  cli_reply reply;
  int helps = 0;
  if (cli_upload(c, path, NULL, repair, &reply) == CLI_DONE && cli_ok(&reply)) {
    helps = 1; /* or at least nothing else would be better */
    if (leaves_most(reply.json, path, repair)) {
      cli_print_repairs(reply.json);
    }
    forget(c, &reply);
  }
  cli_reply_free(&reply);
  return helps;
}

/* Lists the pieces, which --take-part names, or the loops around the handles. */
static void list(const cJSON *problem) {
  const cJSON *item, *lengths = cJSON_GetObjectItemCaseSensitive(problem, "loop_lengths_relative");
  cJSON_ArrayForEach(item, cJSON_GetObjectItemCaseSensitive(problem, "parts")) {
    char triangles[32];
    cli_count(cli_number(item, "triangles"), triangles);
    printf("  part %.0f: %s triangles  %s\n", cli_number(item, "part"), triangles, cli_string(item, "name", ""));
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

static int suggest(cli *c, const char *path, const char *type) {
  if (!strcmp(type, "not-closed") && try_repair(c, path, "fill_holes")) {
    return 1;
  }
  if (!strcmp(type, "not-connected") && try_repair(c, path, "largest_component")) {
    return 1;
  }
  if (!strcmp(type, "not-genus-zero")) {
    return try_repair(c, path, "close_handles");
  }
  if (!strcmp(type, "not-manifold")) {
    return try_repair(c, path, "split_nonmanifold") || try_repair(c, path, "split_nonmanifold,largest_component") ||
           try_repair(c, path, "split_nonmanifold,largest_component,fill_holes");
  }
  if (!strcmp(type, "not-closed") || !strcmp(type, "not-connected")) {
    return try_repair(c, path, "largest_component,fill_holes") ||
           try_repair(c, path, "largest_component,fill_holes,close_handles");
  }
  return 0;
}

static int examine(cli *c, const char *path) {
  cli_reply reply;
  int rc = cli_upload(c, path, NULL, NULL, &reply);
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
      list(reply.json);
    }
    if (reply.json && !suggest(c, path, type) &&
        (!strcmp(type, "not-closed") || !strcmp(type, "not-connected") || !strcmp(type, "not-manifold"))) {
      printf("  None of the daemon's repairs fixes this mesh.\n");
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
