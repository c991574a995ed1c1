/* view: its options. view.c draws. */
#include <stdlib.h>
#include <string.h>

#include "commands.h"
#include "resource.h"
#include "terminal.h"
#include "text.h"
#include "view.h"

static int whole(const cli *c, cli_option_id id, long least, long most, int *out) {
  const char *text = c->args.value[id];
  long value;
  if (!text) {
    return 1;
  }
  if (!cli_whole_number(text, least, most, &value)) {
    cli_error(c, "--%s takes a whole number from %ld to %ld, not '%s'", cli_options[id].name, least, most, text);
    return 0;
  }
  *out = (int)value;
  return 1;
}

static int angle(const cli *c, cli_option_id id, double *out) {
  const char *text = c->args.value[id];
  if (!text || cli_decimal(text, out)) {
    return 1;
  }
  cli_error(c, "--%s takes degrees, not '%s'", cli_options[id].name, text);
  return 0;
}

/* Says which way is up where the view has decided it. */
static void note_up(const cli *c, const view_options *options) {
  static const char *const by[] = {[VIEW_BY_FEET] = "it stands on feet",
                                   [VIEW_BY_LEGS] = "it has two legs",
                                   [VIEW_BY_BASE] = "it has a flat base",
                                   [VIEW_BY_HORNS] = "it has two horns"};
  char axis[3] = {'-', options->up, 0};
  if (options->sign == VIEW_BY_NOTHING) {
    cli_note(c, "nothing in the first shape tells which way is up: y is, as in glTF; --up sets another axis");
  } else if (options->sign != VIEW_BY_USER && options->up != 'y') {
    if (options->up < 'a') {
      axis[1] = (char)(options->up - 'A' + 'a');
    }
    cli_note(c, "%s points up, since the first shape seems to stand that way: %s; --up y shows it as in glTF",
             options->up < 'a' ? axis : axis + 1, by[options->sign]);
  }
}

int cli_run_view(cli *c) {
  const char *glb = c->args.operands[0], *output = c->args.value[OPT_OUTPUT], *up = c->args.value[OPT_UP];
  char error[512] = "";
  view_options options;
  view_defaults(&options);
  if (cli_can_write(c, output, "png apng") != CLI_DONE) {
    return CLI_USAGE;
  }
  if (!whole(c, OPT_POSES, 2, 100, &options.poses) || !whole(c, OPT_SIZE, 16, 4096, &options.size) ||
      !whole(c, OPT_FRAMES, 2, 10000, &options.frames) || !angle(c, OPT_YAW, &options.yaw) ||
      !angle(c, OPT_PITCH, &options.pitch)) {
    return CLI_USAGE;
  }
  if (up && strcmp(up, "auto") != 0) {
    options.up = up[0] == '-' ? (char)(up[1] - 'a' + 'A') : up[0];
  }
  options.wire = c->args.value[OPT_WIRE] != NULL;
  options.inside = c->args.value[OPT_INSIDE] != NULL;
  char *base = cli_base_name(glb), *png = output ? cli_text("%s", output) : cli_text("%s.png", base);
  int rc = CLI_DONE;
  if (view_file(glb, png, &options, error, sizeof error) == 0) {
    printf("%s\n", png);
    note_up(c, &options);
  } else {
    cli_error(c, "%s", error);
    rc = CLI_USAGE;
  }
  free(base);
  free(png);
  return rc;
}
