#include "mesh.h"

#include <errno.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "input.h"
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

/* The file that a --take-part such as 1:Body is for, counted from 0, and the part; −1 if it is for all files. A number
 * that no file has stays one, so that check_parts() refuses it. */
static long file_of_part(const char *value, const char **part) {
  const char *colon = strchr(value, ':');
  char *number = colon ? cli_text("%.*s", (int)(colon - value), value) : NULL;
  long file = -1;
  if (!number || !cli_whole_number(number, 0, INT_MAX, &file)) {
    file = -1;
  }
  free(number);
  *part = file < 0 ? value : colon + 1;
  return file;
}

/* The part that the options name for an operand: the last one for this file, else the last one for all. */
static const char *part_of(const cli *c, int operand) {
  const char *all = NULL, *own = NULL;
  for (int i = 0; i < c->args.part_count; i++) {
    const char *part;
    long file = file_of_part(c->args.parts[i], &part);
    if (file == operand) {
      own = part;
    } else if (file < 0) {
      all = part;
    }
  }
  return own ? own : all;
}

static int check_parts(const cli *c) {
  for (int i = 0; i < c->args.part_count; i++) {
    const char *value = c->args.parts[i], *part;
    long file = file_of_part(value, &part);
    if (file >= c->args.operand_count) {
      cli_error(
          c, "--take-part %s is for file %ld, but the files are 0 to %d; a name that begins so goes to each file: 0:%s",
          value, file, c->args.operand_count - 1, value);
      return CLI_USAGE;
    }
    if (file >= 0 && is_stored(c->args.operands[file])) {
      cli_error(c, "--take-part %s: %s is a mesh that the daemon has already; upload its file with the part", value,
                c->args.operands[file]);
      return CLI_USAGE;
    }
  }
  return CLI_DONE;
}

static int check_mesh(const cli *c, const char *operand) {
  struct stat info;
  if (is_stored(operand) || is_url(operand)) {
    return CLI_DONE;
  }
  int there = stat(operand, &info) == 0, folder = there && S_ISDIR(info.st_mode);
  if (!folder && access(operand, R_OK) == 0) {
    if (!cli_holds_landmarks(operand)) {
      return CLI_DONE;
    }
    cli_error(c, "%s has landmarks, not a mesh: give it to 'orbmorph morph' with --landmarks %s", operand, operand);
    return CLI_USAGE;
  }
  cli_error(c, "%s: %s", operand, folder ? "not a regular file" : strerror(errno));
  return CLI_USAGE;
}

int cli_check_meshes(const cli *c) {
  int rc = check_handle_size(c);
  if (rc == CLI_DONE) {
    rc = check_parts(c);
  }
  for (int i = 0; i < c->args.operand_count && rc == CLI_DONE; i++) {
    rc = check_mesh(c, c->args.operands[i]);
  }
  return rc;
}

/* A parameter, ready to follow a query; empty without a value. */
static char *parameter(const char *name, const char *value) {
  char *escaped = value ? cli_escape(value) : NULL,
       *text = escaped ? cli_text("&%s=%s", name, escaped) : cli_text("%s", "");
  free(escaped);
  return text;
}

int cli_upload(cli *c, const char *path, const char *name, const cli_repairs *repairs, cli_reply *reply) {
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
  char *base = cli_base_name(path), *escaped = cli_escape(name ? name : base);
  char *repair = parameter("repair", repairs->list), *size = parameter("handle_size", repairs->handle_size);
  char *part = parameter("part", repairs->part), *format = parameter("format", c->args.value[OPT_FORMAT]);
  char *target = cli_text("/v1/meshes?name=%s%s%s%s%s", escaped, repair, format, size, part);
  char *label = cli_text("upload %s", base);
  cli_request request = {
      .method = "POST", .path = target, .upload = file, .upload_size = (curl_off_t)info.st_size, .label = label};
  int rc = cli_send(c, &request, reply);
  cli_bar_end(c);
  fclose(file);
  free(base);
  free(escaped);
  free(repair);
  free(size);
  free(part);
  free(format);
  free(target);
  free(label);
  return rc;
}

static int fetch(cli *c, const char *url, const char *name, const cli_repairs *repairs, cli_reply *reply) {
  const char *const members[][2] = {{"url", url},
                                    {"name", name},
                                    {"repair", repairs->list},
                                    {"format", c->args.value[OPT_FORMAT]},
                                    {"part", repairs->part}};
  cJSON *body = cJSON_CreateObject();
  for (size_t i = 0; i < sizeof members / sizeof members[0]; i++) {
    if (members[i][1]) {
      cJSON_AddStringToObject(body, members[i][0], members[i][1]);
    }
  }
  if (repairs->handle_size) {
    cJSON_AddNumberToObject(body, "handle_size", strtod(repairs->handle_size, NULL));
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

int cli_take_in(cli *c, int operand, const char *name, cli_reply *reply) {
  const char *source = c->args.operands[operand];
  cli_repairs repairs = {c->args.value[OPT_REPAIR], c->args.value[OPT_HANDLE_SIZE], part_of(c, operand)};
  memset(reply, 0, sizeof *reply);
  return is_url(source) ? fetch(c, source, name, &repairs, reply) : cli_upload(c, source, name, &repairs, reply);
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

int cli_mesh_of(cli *c, int number, cli_mesh *out) {
  const char *operand = c->args.operands[number];
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
    rc = cli_take_in(c, number, NULL, &reply);
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
