/* upload, embed, job, usage, ls, rm. */
#include <stdlib.h>
#include <string.h>

#include "commands.h"
#include "http.h"
#include "input.h"
#include "job.h"
#include "mesh.h"
#include "problem.h"
#include "report.h"
#include "resource.h"
#include "terminal.h"
#include "text.h"

int cli_run_upload(cli *c) {
  const char *name = c->args.value[OPT_NAME];
  if (name && c->args.operand_count > 1) {
    cli_error(c, "--name needs exactly one file");
    return CLI_USAGE;
  }
  int rc = cli_check_meshes(c);
  for (int i = 0; i < c->args.operand_count && rc == CLI_DONE; i++) {
    cli_reply reply;
    rc = cli_take_in(c, i, name, &reply);
    if (rc == CLI_DONE && !cli_ok(&reply)) {
      rc = cli_refused(c, c->args.operands[i], &reply);
    } else if (rc == CLI_DONE && c->json) {
      puts(reply.body);
    } else if (rc == CLI_DONE) {
      cli_print_mesh(reply.json);
    }
    cli_reply_free(&reply);
  }
  return rc;
}

/* The request of an embedding but for the mesh. Runs before any upload, so that a usage error is reported at once. */
static int embedding_request(cli *c, cJSON **out) {
  cJSON *request = cJSON_CreateObject();
  *out = request;
  if (c->args.value[OPT_METHOD]) {
    cJSON_AddStringToObject(request, "method", c->args.value[OPT_METHOD]);
  }
  if (c->args.value[OPT_PRESET]) {
    cJSON_AddStringToObject(cJSON_AddObjectToObject(request, "options"), "preset", c->args.value[OPT_PRESET]);
  }
  return cli_apply_sets(c, request);
}

static int embed_one(cli *c, int operand, const cJSON *settings) {
  cli_mesh mesh;
  cli_reply reply = {0};
  int rc = cli_mesh_of(c, operand, &mesh);
  if (rc != CLI_DONE) {
    return rc;
  }
  cJSON *request = cJSON_Duplicate(settings, 1);
  cli_set_member(request, "mesh", cJSON_CreateString(mesh.id));
  rc = cli_make(c, "/v1/embeddings", request, &reply);
  if (rc == CLI_DONE && reply.json) {
    if (c->json) {
      puts(reply.body);
    } else {
      cli_print_embedding(reply.json);
    }
    if (c->args.value[OPT_OUTPUT]) {
      char *path = cli_text("%s/sphere.ply", cli_string(reply.json, "url", ""));
      rc = cli_download(c, path, c->args.value[OPT_OUTPUT]);
      free(path);
    }
  }
  cli_reply_free(&reply);
  cJSON_Delete(request);
  cli_mesh_free(&mesh);
  return rc;
}

int cli_run_embed(cli *c) {
  cJSON *settings = NULL;
  if (c->args.value[OPT_OUTPUT] && c->args.operand_count > 1) {
    cli_error(c, "--output needs exactly one mesh");
    return CLI_USAGE;
  }
  int rc = cli_can_write(c, c->args.value[OPT_OUTPUT], "ply");
  if (rc == CLI_DONE) {
    rc = embedding_request(c, &settings);
  }
  if (rc == CLI_DONE) {
    rc = cli_check_meshes(c);
  }
  for (int i = 0; i < c->args.operand_count && rc == CLI_DONE; i++) {
    rc = embed_one(c, i, settings);
  }
  cJSON_Delete(settings);
  return rc;
}

int cli_run_job(cli *c) {
  char *path = NULL, *result = NULL;
  cli_reply reply = {0};
  int rc = cli_locate(c, "jobs", c->args.operands[0], &path);
  if (rc != CLI_DONE) {
    return rc;
  }
  cli_request request = {.method = c->args.value[OPT_CANCEL] ? "DELETE" : "GET", .path = path};
  rc = cli_send(c, &request, &reply);
  if (rc == CLI_DONE && !cli_ok(&reply)) {
    rc = cli_not_found(c, "job", c->args.operands[0], &reply);
  }
  if (rc == CLI_DONE && c->args.value[OPT_WAIT] && reply.json) {
    rc = cli_wait(c, reply.json, &result);
    if (rc == CLI_DONE) {
      cli_reply_free(&reply);
      rc = cli_get(c, path, &reply);
    }
  }
  if (rc == CLI_DONE && reply.body && c->json) {
    puts(reply.body);
  } else if (rc == CLI_DONE && reply.json) {
    cli_print_job(reply.json);
  }
  free(result);
  free(path);
  cli_reply_free(&reply);
  return rc;
}

/* "1,234 of 5,000 bytes in ": a number with its quota, if there is one. */
static void print_used(const cJSON *item, const char *name, const char *unit) {
  const cJSON *quotas = cJSON_GetObjectItemCaseSensitive(item, "quotas");
  char used[32], quota[32];
  cli_count(cli_number(item, name), used);
  cli_count(cli_number(quotas, name), quota);
  printf("%s%s%s%s", used, cli_number(quotas, name) > 0 ? " of " : "", cli_number(quotas, name) > 0 ? quota : "", unit);
}

static void print_usage(const cJSON *item) {
  const char *tenant = cli_string(item, "tenant", "");
  char meshes[32];
  cli_count(cli_number(item, "meshes"), meshes);
  printf("%s: ", *tenant ? tenant : "(without token)");
  print_used(item, "bytes", " bytes in ");
  printf("%s %s, ", meshes, cli_number(item, "meshes") > 1 || cli_number(item, "meshes") < 1 ? "meshes" : "mesh");
  print_used(item, "derived_bytes", " bytes of results, ");
  printf("%.0f jobs running and %.0f queued, %.1f worker seconds, %.0f crashes\n", cli_number(item, "running"),
         cli_number(item, "queued"), cli_number(item, "worker_seconds"), cli_number(item, "crashes"));
}

static void print_row(const char *collection, const cJSON *item) {
  char triangles[32];
  cli_count(cli_number(item, "triangles"), triangles);
  if (!strcmp(collection, "jobs")) {
    cli_print_job(item);
  } else if (!strcmp(collection, "meshes")) {
    printf("%s  %10s  %-5s %s\n", cli_string(item, "id", "?"), triangles, cli_string(item, "format", ""),
           cli_string(item, "name", ""));
  } else if (!strcmp(collection, "embeddings")) {
    printf("%s  %-16s mesh %.12s\n", cli_string(item, "id", "?"), cli_string(item, "method", ""),
           cli_string(item, "mesh", ""));
  } else if (!strcmp(collection, "usage")) {
    print_usage(item);
  } else {
    printf("%s  %10s ", cli_string(item, "id", "?"), triangles);
    const cJSON *shape;
    cJSON_ArrayForEach(shape, cJSON_GetObjectItemCaseSensitive(item, "shapes")) {
      printf(" %s", cli_string(shape, "name", "?"));
    }
    putchar('\n');
  }
}

/* The items of a page: its only member that is an array. */
static const cJSON *page_items(const cJSON *page) {
  for (const cJSON *item = page ? page->child : NULL; item; item = item->next) {
    if (cJSON_IsArray(item)) {
      return item;
    }
  }
  return NULL;
}

static int list(cli *c, const char *collection, long limit) {
  char *token = NULL;
  const char *state = c->args.value[OPT_STATE];
  int rc = CLI_DONE;
  do {
    char *wanted = state ? cli_escape(state) : NULL, *from = token ? cli_escape(token) : NULL;
    int brief = !c->json && !strcmp(collection, "supermeshes");
    char *path =
        cli_text("/v1/%s?limit=%ld%s%s%s%s%s", collection, limit < 100 ? limit : 100, brief ? "&view=summary" : "",
                 wanted ? "&state=" : "", wanted ? wanted : "", from ? "&page_token=" : "", from ? from : "");
    cli_reply reply = {0};
    rc = cli_get(c, path, &reply);
    free(path);
    free(wanted);
    free(from);
    free(token);
    token = NULL;
    if (rc == CLI_DONE && !cli_ok(&reply)) {
      rc = cli_refused(c, NULL, &reply);
    }
    if (rc == CLI_DONE && c->json) {
      puts(reply.body);
    }
    const cJSON *item;
    if (rc == CLI_DONE) {
      cJSON_ArrayForEach(item, page_items(reply.json)) {
        if (!c->json) {
          print_row(collection, item);
        }
        limit--;
      }
    }
    const char *next = cli_string(reply.json, "next_page_token", NULL);
    if (rc == CLI_DONE && next && *next && limit > 0) {
      token = cli_text("%s", next);
    }
    cli_reply_free(&reply);
  } while (token);
  return rc;
}

static int read_limit(cli *c, long *limit) {
  *limit = 1000000;
  if (c->args.value[OPT_LIMIT] && !cli_whole_number(c->args.value[OPT_LIMIT], 1, 1000000, limit)) {
    cli_error(c, "--limit takes a whole number from 1 to 1000000");
    return 0;
  }
  return 1;
}

int cli_run_usage(cli *c) {
  long limit;
  return read_limit(c, &limit) ? list(c, "usage", limit) : CLI_USAGE;
}

int cli_run_ls(cli *c) {
  static const char *const collections[] = {"meshes", "embeddings", "supermeshes", "jobs"};
  const char *wanted = c->args.operand_count ? c->args.operands[0] : c->args.value[OPT_STATE] ? "jobs" : "meshes";
  long limit;
  if (!read_limit(c, &limit)) {
    return CLI_USAGE;
  }
  for (size_t i = 0; i < 4; i++) {
    if (!strcmp(wanted, collections[i])) {
      return list(c, wanted, limit);
    }
  }
  cli_error(c, "cannot list '%s'; choose meshes, embeddings, supermeshes or jobs", wanted);
  return CLI_USAGE;
}

int cli_run_rm(cli *c) {
  int rc = CLI_DONE;
  for (int i = 0; i < c->args.operand_count && rc == CLI_DONE; i++) {
    char *path = NULL;
    cli_reply reply = {0};
    rc = cli_find(c, c->args.operands[i], &path, &reply);
    cli_reply_free(&reply);
    if (rc == CLI_DONE) {
      cli_request request = {.method = "DELETE", .path = path};
      rc = cli_send(c, &request, &reply);
      if (rc == CLI_DONE && !cli_ok(&reply)) {
        rc = cli_refused(c, c->args.operands[i], &reply);
      }
      cli_reply_free(&reply);
    }
    free(path);
  }
  return rc;
}
