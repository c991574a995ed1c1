#include "mesh.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "prefix.h"
#include "problem.h"
#include "resource.h"
#include "terminal.h"
#include "text.h"

/* An operand that names a file is that file, even if its name could be an id. */
static int is_stored(const char *operand) {
  return (cli_is_id(operand) || cli_is_prefix(operand)) && access(operand, F_OK) != 0;
}

/* No file has such a name, unless a folder is called "http:". */
static int is_url(const char *operand) {
  return strncasecmp(operand, "http://", 7) == 0 || strncasecmp(operand, "https://", 8) == 0;
}

/* The daemon's own bounds, so that a wrong number is refused before anything is uploaded. */
static int check_handle_size(const cli *c) {
  const char *size = c->args.value[OPT_HANDLE_SIZE];
  double x;
  if (!size || (cli_decimal(size, &x) && x >= 1e-6 && x <= 10)) {
    return CLI_DONE;
  }
  cli_error(c, "--handle-size takes a number from 0.000001 to 10, a fraction of the diagonal, not '%s'", size);
  return CLI_USAGE;
}

int cli_check_mesh(const cli *c, const char *operand) {
  struct stat info;
  int rc = check_handle_size(c);
  if (rc != CLI_DONE) {
    return rc;
  }
  if (is_stored(operand) || is_url(operand)) {
    return CLI_DONE;
  }
  int there = stat(operand, &info) == 0, folder = there && S_ISDIR(info.st_mode);
  if (!folder && access(operand, R_OK) == 0) {
    return CLI_DONE;
  }
  cli_error(c, "%s: %s", operand, folder ? "not a regular file" : strerror(errno));
  return CLI_USAGE;
}

/* The parameters of repairs, ready to follow a query. */
static char *repair_parameters(const cli *c) {
  const char *size = c->args.value[OPT_HANDLE_SIZE], *part = c->args.value[OPT_TAKE_PART];
  char *sizes = size ? cli_escape(size) : NULL, *parts = part ? cli_escape(part) : NULL;
  char *text =
      cli_text("%s%s%s%s", sizes ? "&handle_size=" : "", sizes ? sizes : "", parts ? "&part=" : "", parts ? parts : "");
  free(sizes);
  free(parts);
  return text;
}

int cli_upload(cli *c, const char *path, const char *name, const char *repair, cli_reply *reply) {
  memset(reply, 0, sizeof *reply);
  FILE *file = fopen(path, "rb");
  struct stat info;
  if (!file || fstat(fileno(file), &info) != 0 || S_ISDIR(info.st_mode)) {
    cli_error(c, "%s: %s", path, file ? "not a regular file" : strerror(errno));
    if (file) {
      fclose(file);
    }
    return CLI_USAGE;
  }
  char *base = cli_base_name(path), *escaped = cli_escape(name ? name : base), *target;
  char *repairs = repair ? cli_escape(repair) : NULL;
  const char *format = c->args.value[OPT_FORMAT];
  char *kind = format ? cli_escape(format) : NULL;
  char *more = repair_parameters(c);
  target = cli_text("/v1/meshes?name=%s%s%s%s%s%s", escaped, repairs ? "&repair=" : "", repairs ? repairs : "",
                    kind ? "&format=" : "", kind ? kind : "", more);
  free(more);
  char *label = cli_text("upload %s", base);
  cli_request request = {
      .method = "POST", .path = target, .upload = file, .upload_size = (curl_off_t)info.st_size, .label = label};
  int rc = cli_send(c, &request, reply);
  cli_bar_end(c);
  fclose(file);
  free(base);
  free(escaped);
  free(repairs);
  free(kind);
  free(target);
  free(label);
  return rc;
}

static int fetch(cli *c, const char *url, const char *name, const char *repair, cli_reply *reply) {
  const char *const members[][2] = {{"url", url},
                                    {"name", name},
                                    {"repair", repair},
                                    {"format", c->args.value[OPT_FORMAT]},
                                    {"part", c->args.value[OPT_TAKE_PART]}};
  cJSON *body = cJSON_CreateObject();
  for (size_t i = 0; i < sizeof members / sizeof members[0]; i++) {
    if (members[i][1]) {
      cJSON_AddStringToObject(body, members[i][0], members[i][1]);
    }
  }
  if (c->args.value[OPT_HANDLE_SIZE]) {
    cJSON_AddNumberToObject(body, "handle_size", strtod(c->args.value[OPT_HANDLE_SIZE], NULL));
  }
  char *text = cJSON_PrintUnformatted(body);
  cli_request request = {.method = "POST", .path = "/v1/meshes", .json = text};
  int rc = cli_send(c, &request, reply);
  if (rc == CLI_DONE && reply->status == 202) {
    rc = cli_await(c, reply);
  }
  cJSON_free(text);
  cJSON_Delete(body);
  return rc;
}

int cli_take_in(cli *c, const char *operand, const char *name, const char *repair, cli_reply *reply) {
  memset(reply, 0, sizeof *reply);
  return is_url(operand) ? fetch(c, operand, name, repair, reply) : cli_upload(c, operand, name, repair, reply);
}

static void note_mesh(const cli *c, const char *operand, const cli_reply *reply) {
  char triangles[32];
  cli_count(cli_number(reply->json, "triangles"), triangles);
  cli_note(c, "%s: %s triangles%s", operand, triangles, reply->status == 200 ? ", already uploaded" : "");
  const cJSON *repair;
  cJSON_ArrayForEach(repair, cJSON_GetObjectItemCaseSensitive(reply->json, "repairs")) {
    char count[32];
    cli_count(cli_number(repair, "count"), count);
    cli_note(c, "  repaired: %s (%s)", cli_string(repair, "kind", "?"), count);
  }
}

int cli_mesh_of(cli *c, const char *operand, cli_mesh *out) {
  cli_reply reply = {0};
  int rc, known = is_stored(operand), named = known || is_url(operand);
  memset(out, 0, sizeof *out);
  if (known) {
    char *path = NULL;
    rc = cli_locate(c, "meshes", operand, &path);
    if (rc == CLI_DONE) {
      rc = cli_get(c, path, &reply);
    }
    free(path);
  } else {
    rc = cli_take_in(c, operand, NULL, c->args.value[OPT_REPAIR], &reply);
  }
  if (rc == CLI_DONE && !cli_ok(&reply)) {
    rc = cli_refused(c, operand, &reply);
    const char *advice = reply.json ? cli_advice(cli_problem_type(reply.json)) : NULL;
    if (advice && !c->json) {
      cli_note(c, "  %s", advice);
    }
  }
  if (rc == CLI_DONE) {
    if (!known) {
      note_mesh(c, operand, &reply);
    }
    out->id = cli_text("%s", cli_string(reply.json, "id", ""));
    out->name = named ? cli_text("%s", cli_string(reply.json, "name", "")) : cli_base_name(operand);
  }
  cli_reply_free(&reply);
  return rc;
}

void cli_mesh_free(cli_mesh *mesh) {
  free(mesh->id);
  free(mesh->name);
  memset(mesh, 0, sizeof *mesh);
}
