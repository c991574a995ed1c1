/* morph and merge: build the request, wait, download. */
#include <limits.h>
#include <stdlib.h>
#include <string.h>

#include "commands.h"
#include "http.h"
#include "input.h"
#include "mesh.h"
#include "problem.h"
#include "report.h"
#include "resource.h"
#include "terminal.h"
#include "text.h"

#define NO_MESH "0000000000000000000000000000000000000000000000000000000000000000" /* no file has this hash */

static void set_text(const cli *c, cJSON *request, cli_option_id option, const char *path) {
  if (c->args.value[option]) {
    cli_set_member(request, path, cJSON_CreateString(c->args.value[option]));
  }
}

/* One entry of --transfer, such as 1:texture:2048. Returns NULL after printing why it is not valid. */
static cJSON *read_transfer(const cli *c, char *entry) {
  char *whole = cli_text("%s", entry), *shape = strsep(&entry, ":"), *what = strsep(&entry, ":"), *texels = entry;
  long from, resolution = 0, last = c->args.operand_count - 1;
  cJSON *out = NULL;
  if (!cli_whole_number(shape, 0, INT_MAX, &from) || !what || !*what) {
    cli_error(
        c, "--transfer takes a list such as 1:skin,1:texture:2048 (the shape, from 0; what; texels a side), not '%s'",
        c->args.value[OPT_TRANSFER]);
  } else if (from > last) {
    cli_error(c, "--transfer %s: there is no shape %ld; the files are shapes 0 to %ld", whole, from, last);
  } else if (texels && !cli_whole_number(texels, 16, 8192, &resolution)) {
    cli_error(c, "--transfer %s: the texels a side are a whole number from 16 to 8192", whole);
  } else {
    out = cJSON_CreateObject();
    cJSON_AddNumberToObject(out, "from", (double)from);
    cJSON_AddStringToObject(out, "what", what);
  }
  if (out && texels) {
    cJSON_AddNumberToObject(out, "resolution", (double)resolution);
  }
  free(whole);
  return out;
}

static int add_transfer(const cli *c, cJSON *request) {
  const char *list = c->args.value[OPT_TRANSFER];
  char *text = list ? cli_text("%s", list) : NULL, *rest = text, *entry;
  cJSON *out = list ? cJSON_AddArrayToObject(request, "transfer") : NULL, *item = out;
  while (item && (entry = strsep(&rest, ","))) {
    item = read_transfer(c, entry);
    cJSON_AddItemToArray(out, item);
  }
  free(text);
  return list && !item ? CLI_USAGE : CLI_DONE;
}

static int add_options(const cli *c, cJSON *request) {
  const char *tolerance = c->args.value[OPT_TOLERANCE], *triangles = c->args.value[OPT_MAX_TRIANGLES];
  double x;
  long n;
  const char *align = c->args.value[OPT_ALIGN];
  if (align && !c->args.value[OPT_LANDMARKS] && (!strcmp(align, "pin") || !strcmp(align, "rbf"))) {
    cli_error(c, "--align %s needs --landmarks", align);
    return CLI_USAGE;
  }
  set_text(c, request, OPT_ALIGN, "align.method");
  set_text(c, request, OPT_REMESH, "remesh.method");
  set_text(c, request, OPT_ANIMATION, "asset.animation");
  set_text(c, request, OPT_FIT, "asset.fit");
  set_text(c, request, OPT_PATH, "asset.path");
  if (tolerance) {
    if (!cli_fraction(tolerance, &x) || !(x >= 1e-9 && x <= 1)) {
      cli_error(c, "--tolerance takes a number from 1e-9 to 1, or a percentage such as 0.1%%, not '%s'", tolerance);
      return CLI_USAGE;
    }
    cli_set_member(request, "remesh.tolerance", cJSON_CreateNumber(x));
  }
  if (triangles) {
    if (!cli_whole_number(triangles, 4, 100000000, &n)) {
      cli_error(c, "--max-triangles takes a whole number from 4 to 100000000, not '%s'", triangles);
      return CLI_USAGE;
    }
    cli_set_member(request, "remesh.max_triangles", cJSON_CreateNumber((double)n));
  }
  if (c->args.value[OPT_NO_NORMALS]) {
    cli_set_member(request, "asset.normals", cJSON_CreateBool(0));
  }
  int rc = add_transfer(c, request);
  if (rc != CLI_DONE) {
    return rc;
  }
  return cli_apply_sets(c, request);
}

/* Whether each landmark has a place on each shape. The daemon reports everything else that is wrong with a landmark. */
static int have_all_shapes(const cli *c, const char *file, const cJSON *list) {
  const cJSON *item;
  int number = 0;
  cJSON_ArrayForEach(item, list) {
    const cJSON *at = cJSON_GetObjectItemCaseSensitive(item, "at");
    int places = cJSON_GetArraySize(at);
    if (cJSON_IsArray(at) && places != c->args.operand_count) {
      cli_error(c, "%s: landmark %d has %d places, but the command names %d shapes", file, number, places,
                c->args.operand_count);
      return 0;
    }
    number++;
  }
  return 1;
}

/* Everything but the shapes. Runs before any upload, so that a usage error is reported at once. */
static int make_request(cli *c, cJSON **out) {
  const char *landmarks = c->args.value[OPT_LANDMARKS];
  cJSON *request = cJSON_CreateObject();
  cJSON_AddArrayToObject(request, "shapes");
  *out = request;
  if (landmarks && !strcmp(landmarks, "auto")) {
    cJSON_AddStringToObject(request, "landmarks", "auto");
  } else if (landmarks) {
    cJSON *list = cli_read_landmarks(c, landmarks);
    if (!list) {
      return CLI_USAGE;
    }
    cJSON_AddItemToObject(request, "landmarks", list);
    if (!have_all_shapes(c, landmarks, list)) {
      return CLI_USAGE;
    }
  }
  return add_options(c, request);
}

/* Lets the daemon check, before any upload, what only the daemon can check. Sends the request with meshes that do not
 * exist: the daemon reads all of a request before it looks for its meshes. */
static int ask_daemon(cli *c, const cJSON *request) {
  if (cJSON_GetArraySize(request) == 1) {
    return CLI_DONE; /* nothing but the shapes */
  }
  cJSON *copy = cJSON_Duplicate(request, 1), *shapes = cJSON_GetObjectItemCaseSensitive(copy, "shapes");
  for (int i = 0; i < c->args.operand_count; i++) {
    cJSON *shape = cJSON_CreateObject();
    cJSON_AddStringToObject(shape, "mesh", NO_MESH);
    cJSON_AddItemToArray(shapes, shape);
  }
  char *text = cJSON_PrintUnformatted(copy);
  cli_reply reply = {0};
  int rc = cli_send(c, &(cli_request){.method = "POST", .path = "/v1/supermeshes", .json = text}, &reply);
  if (rc == CLI_DONE && reply.status != 404) {
    rc = cli_refused(c, NULL, &reply);
  }
  cli_reply_free(&reply);
  free(text);
  cJSON_Delete(copy);
  return rc;
}

static int add_shapes(cli *c, cJSON *request) {
  cJSON *shapes = cJSON_GetObjectItemCaseSensitive(request, "shapes");
  for (int i = 0; i < c->args.operand_count; i++) {
    cli_mesh mesh;
    int rc = cli_mesh_of(c, i, &mesh);
    if (rc != CLI_DONE) {
      return rc;
    }
    cJSON *shape = cJSON_CreateObject();
    cJSON_AddStringToObject(shape, "mesh", mesh.id);
    cJSON_AddStringToObject(shape, "name", mesh.name);
    cJSON_AddItemToArray(shapes, shape);
    cli_mesh_free(&mesh);
  }
  return CLI_DONE;
}

static int finish(cli *c, const cli_reply *supermesh, const char *output) {
  const char *report = c->args.value[OPT_REPORT];
  int rc = CLI_DONE;
  if (output) {
    char *asset = cli_asset_path(c, cli_string(supermesh->json, "asset", ""));
    rc = cli_download(c, asset, output);
    free(asset);
  }
  if (rc == CLI_DONE && report) {
    rc = cli_write_report(c, report, supermesh);
  }
  if (rc != CLI_DONE || (output && !strcmp(output, "-"))) {
    return rc;
  }
  if (c->json) {
    puts(supermesh->body);
  } else {
    if (output) {
      printf("%s\n", output);
    }
    cli_print_supermesh(supermesh->json);
  }
  return CLI_DONE;
}

static int merge(cli *c, const char *output) {
  cJSON *request = NULL;
  cli_reply supermesh = {0};
  int rc = cli_check_profile(c) ? cli_can_write(c, output, "glb") : CLI_USAGE;
  if (rc == CLI_DONE) {
    rc = cli_can_write(c, c->args.value[OPT_REPORT], "md json");
  }
  if (rc == CLI_DONE) {
    rc = make_request(c, &request);
  }
  if (rc == CLI_DONE) {
    rc = cli_check_meshes(c);
  }
  if (rc == CLI_DONE) {
    rc = ask_daemon(c, request);
  }
  if (rc == CLI_DONE) {
    rc = add_shapes(c, request);
  }
  if (rc == CLI_DONE) {
    rc = cli_make(c, "/v1/supermeshes", request, &supermesh);
  }
  if (rc == CLI_DONE && supermesh.json) {
    rc = finish(c, &supermesh, output);
  }
  cli_reply_free(&supermesh);
  cJSON_Delete(request);
  return rc;
}

int cli_run_merge(cli *c) {
  return merge(c, c->args.value[OPT_OUTPUT]);
}

int cli_run_morph(cli *c) {
  const char *output = c->args.value[OPT_OUTPUT];
  if (output) {
    return merge(c, output);
  }
  char *first = cli_base_name(c->args.operands[0]), *last = cli_base_name(c->args.operands[c->args.operand_count - 1]);
  char *made = cli_text("%s-%s.glb", first, last);
  int rc = merge(c, made);
  free(first);
  free(last);
  free(made);
  return rc;
}
