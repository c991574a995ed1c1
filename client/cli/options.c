#include "options.h"

#include <glob.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "program.h"
#include "text.h"

_Static_assert(OPT_COUNT <= 64, "a command holds its options in 64 bits");

const cli_option cli_options[OPT_COUNT] = {
    [OPT_SERVER] = {"server", 's', "URL", NULL,
                    "address of the daemon, or unix:PATH; default: $ORBMORPH_SERVER or " CLI_DEFAULT_SERVER},
    [OPT_JSON] = {"json", 0, NULL, NULL, "print the daemon's JSON"},
    [OPT_QUIET] = {"quiet", 'q', NULL, NULL, "print no progress and no notes"},
    [OPT_HELP] = {"help", 'h', NULL, NULL, "show this help"},
    [OPT_OUTPUT] = {"output", 'o', "FILE", NULL,
                    "write the result to FILE, whose ending must fit; - is standard output"},
    [OPT_REPORT] = {"report", 0, "FILE", NULL, "also write a report: Markdown if FILE ends in .md, else JSON"},
    [OPT_LANDMARKS] = {"landmarks", 'l', "FILE", NULL, "read landmarks from FILE, or find them with auto"},
    [OPT_ALIGN] = {"align", 0, "METHOD", "pin rbf rotate auto", "alignment method"},
    [OPT_REMESH] = {"remesh", 0, "METHOD", "adaptive overlay subdivision convex-hull template", "remeshing method"},
    [OPT_TOLERANCE] = {"tolerance", 't', "X", NULL,
                       "allowed error as a fraction of each shape's diagonal, such as 0.001 or 0.1%"},
    [OPT_MAX_TRIANGLES] = {"max-triangles", 'n', "N", NULL, "make at most N triangles"},
    [OPT_NO_NORMALS] = {"no-normals", 0, NULL, NULL, "write no normals into the asset"},
    [OPT_ANIMATION] = {"animation", 0, "KIND", "pingpong none", "animation in the asset"},
    [OPT_FIT] = {"fit", 0, "KIND", "auto none rigid similarity", "move the other shapes onto the first"},
    [OPT_PATH] = {"path", 0, "KIND", "linear rigid", "path of the vertices between shapes"},
    [OPT_TRANSFER] =
        {"transfer", 0, "LIST", NULL,
         "give the asset what other shapes have: SHAPE:skin, color, texcoord, targets or texture[:TEXELS], "
         "separated by commas"},
    [OPT_SET] = {"set", 0, "NAME=VALUE", NULL, "set any member of the request, such as align.options.radius=0.5"},
    [OPT_NO_WAIT] = {"no-wait", 0, NULL, NULL, "print the job and do not wait for it"},
    [OPT_NAME] = {"name", 0, "NAME", NULL, "name of the mesh; default: the name of the file"},
    [OPT_REPAIR] = {"repair", 0, "LIST", "safe none fill_holes largest_component split_nonmanifold close_handles",
                    "allowed repairs, separated by commas"},
    [OPT_HANDLE_SIZE] = {"handle-size", 0, "X", NULL,
                         "longest loop that close_handles cuts along, as a fraction of the diagonal; default: 0.05"},
    [OPT_TAKE_PART] = {"take-part", 0, "PART", NULL,
                       "keep this piece: a number from 0 by size, or a name; N:PART is for file N only, from 0"},
    [OPT_FORMAT] = {"format", 0, "FORMAT", "obj off ply stl 3mf gltf glb",
                    "file format; default: detected from the content"},
    [OPT_METHOD] = {"method", 0, "METHOD", "newton kernel-sampling", "embedding method"},
    [OPT_PRESET] = {"preset", 0, "PRESET", "fast default quality", "effort of the embedding"},
    [OPT_WAIT] = {"wait", 'w', NULL, NULL, "wait until the job ends"},
    [OPT_CANCEL] = {"cancel", 0, NULL, NULL, "cancel the job"},
    [OPT_STATE] = {"state", 0, "STATE", "queued running succeeded failed cancelled", "list only jobs in this state"},
    [OPT_LIMIT] = {"limit", 0, "N", NULL, "list at most N"},
    [OPT_PART] = {"part", 0, "PART", "file asset sphere", "download the data of a mesh, a supermesh or an embedding"},
    [OPT_POSES] = {"poses", 0, "N", NULL, "poses in each row; default: 5"},
    [OPT_SIZE] = {"size", 0, "PIXELS", NULL, "width and height of a pose; default: 320"},
    [OPT_UP] = {"up", 0, "AXIS", "auto y z x -y -z -x", "axis that points up; default: auto"},
    [OPT_YAW] = {"yaw", 0, "DEGREES", NULL, "rotate the view around the up axis; default: the largest side shows"},
    [OPT_PITCH] = {"pitch", 0, "DEGREES", NULL, "look from above; default: 15"},
    [OPT_WIRE] = {"wire", 0, NULL, NULL, "draw the edges of the triangles"},
    [OPT_INSIDE] = {"inside", 0, NULL, NULL, "paint triangles seen from inside red"},
    [OPT_FRAMES] = {"frames", 0, "N", NULL, "draw an animated PNG of N frames, 20 per second, instead of a sheet"},
    [OPT_KEY] = {"key", 'k', "KEY:SECRET", NULL, "signing key; default: $ORBMORPH_KEY"},
    [OPT_EXPIRES] = {"expires", 0, "TIME", NULL, "required: time until the signature expires, such as 30d, 12h or 90m"},
    [OPT_PROFILE] = {"profile", 0, "PROFILE", "float quantized meshopt", "profile of the downloaded asset"},
    [OPT_DATA] = {"data", 0, "DIR", NULL, "data folder; default: ~/.local/share/orbmorph"},
    [OPT_NO_OPEN] = {"no-open", 0, NULL, NULL, "print the address and open no browser"},
};

static int find_long(const cli_command *command, const char *text, size_t length) {
  for (int id = 0; id < OPT_COUNT; id++) {
    if ((command->options & CLI_BIT(id)) && strlen(cli_options[id].name) == length &&
        !strncmp(cli_options[id].name, text, length)) {
      return id;
    }
  }
  return -1;
}

static int find_letter(const cli_command *command, char letter) {
  for (int id = 0; id < OPT_COUNT; id++) {
    if ((command->options & CLI_BIT(id)) && cli_options[id].letter == letter && letter) {
      return id;
    }
  }
  return -1;
}

int cli_knows_option(const char *text) {
  static const cli_command any = {.options = UINT64_MAX};
  size_t length = strcspn(text, "=");
  return text[1] == '-' ? find_long(&any, text + 2, length - 2) >= 0 : find_letter(&any, text[1]) >= 0;
}

static int usage_error(const cli_command *command, const char *what, const char *text) {
  fprintf(stderr, "orbmorph %s: %s %s\nTry 'orbmorph %s --help'.\n", command->name, what, text, command->name);
  return CLI_USAGE;
}

/* Whether each item of a comma list is one of the words. */
static int are_choices(const char *words, const char *list) {
  for (const char *item = list;; item++) {
    size_t length = strcspn(item, ",");
    int found = 0;
    for (const char *word = words; *word && !found; word += strspn(word, " ")) {
      size_t size = strcspn(word, " ");
      found = size == length && !strncmp(word, item, size);
      word += size;
    }
    item += length;
    if (!found || !*item) {
      return found;
    }
  }
}

/* Whether the value is one that the option takes. The daemon knows the same values, but it sees them only after the
 * uploads. */
static int check_choice(const cli_command *command, int id, const char *value) {
  const cli_option *o = &cli_options[id];
  if (!o->choices || (are_choices(o->choices, value) && (id == OPT_REPAIR || !strchr(value, ',')))) {
    return CLI_DONE;
  }
  char *text = cli_text("'%s'; choose from: %s", value, o->choices), *what = cli_text("option --%s cannot be", o->name);
  int rc = usage_error(command, what, text);
  free(what);
  free(text);
  return rc;
}

static int store(cli_args *out, int id, const char *value) {
  if (id == OPT_TAKE_PART) {
    out->parts = realloc(out->parts, (size_t)(out->part_count + 1) * sizeof(char *));
    if (!out->parts) {
      exit(CLI_REFUSED);
    }
    out->parts[out->part_count++] = value;
  }
  if (id != OPT_SET) {
    out->value[id] = value;
    return 1;
  }
  if (out->set_count == CLI_SETS_MAX) {
    return 0;
  }
  out->sets[out->set_count++] = value;
  return 1;
}

static void add_operand(cli_args *out, const char *text) {
  out->operands = realloc(out->operands, (size_t)(out->operand_count + 1) * sizeof(char *));
  if (!out->operands) {
    exit(CLI_REFUSED);
  }
  out->operands[out->operand_count++] = cli_text("%s", text);
}

/* Expands a pattern that the shell did not expand because it was quoted. */
static void add_operands(cli_args *out, const char *text) {
  glob_t found;
  if (strpbrk(text, "*?[") && access(text, F_OK) != 0 && glob(text, 0, NULL, &found) == 0) {
    for (size_t i = 0; i < found.gl_pathc; i++) {
      add_operand(out, found.gl_pathv[i]);
    }
    globfree(&found);
    return;
  }
  add_operand(out, text);
}

/* Parses the option argv[*i]; advances *i if its value is the next argument. */
static int parse_option(const cli_command *command, int argc, char **argv, int *i, cli_args *out) {
  const char *text = argv[*i], *value = NULL;
  int id;
  if (text[1] == '-') {
    const char *equals = strchr(text, '=');
    size_t length = equals ? (size_t)(equals - text - 2) : strlen(text + 2);
    id = find_long(command, text + 2, length);
    value = equals ? equals + 1 : NULL;
  } else {
    id = find_letter(command, text[1]);
    value = text[2] ? text + 2 : NULL;
  }
  if (id < 0) {
    return usage_error(command, "unknown option", text);
  }
  if (!cli_options[id].value) {
    if (value) {
      return usage_error(command, "option takes no value:", text);
    }
    value = "";
  } else if (!value) {
    if (*i + 1 >= argc) {
      return usage_error(command, "option needs a value:", text);
    }
    value = argv[++*i];
  }
  int rc = check_choice(command, id, value);
  return rc != CLI_DONE ? rc : store(out, id, value) ? CLI_DONE : usage_error(command, "too many options:", text);
}

int cli_parse(const cli_command *command, int argc, char **argv, int first, cli_args *out) {
  int literal = 0;
  memset(out, 0, sizeof *out);
  for (int i = first; i < argc; i++) {
    if (!literal && !strcmp(argv[i], "--")) {
      literal = 1;
    } else if (!literal && argv[i][0] == '-' && argv[i][1]) {
      int rc = parse_option(command, argc, argv, &i, out);
      if (rc != CLI_DONE) {
        return rc;
      }
    } else if (literal) {
      add_operand(out, argv[i]);
    } else {
      add_operands(out, argv[i]);
    }
  }
  if (out->value[OPT_HELP]) {
    return CLI_DONE;
  }
  if (out->operand_count < command->least) {
    return usage_error(command, "too few arguments; it takes", command->operands);
  }
  if (command->most >= 0 && out->operand_count > command->most) {
    return usage_error(command, "too many arguments; it takes", *command->operands ? command->operands : "none");
  }
  return CLI_DONE;
}

void cli_args_free(cli_args *args) {
  for (int i = 0; i < args->operand_count; i++) {
    free(args->operands[i]);
  }
  free(args->operands);
  free(args->parts);
  memset(args, 0, sizeof *args);
}

static void help_option(FILE *out, int id) {
  const cli_option *o = &cli_options[id];
  char left[64];
  if (o->letter) {
    snprintf(left, sizeof left, "-%c, --%s%s%s", o->letter, o->name, o->value ? " " : "", o->value ? o->value : "");
  } else {
    snprintf(left, sizeof left, "    --%s%s%s", o->name, o->value ? " " : "", o->value ? o->value : "");
  }
  fprintf(out, "  %-26s %s", left, o->help);
  if (o->choices) {
    fprintf(out, " (%s)", o->choices);
  }
  fputc('\n', out);
}

void cli_help_command(FILE *out, const cli_command *command) {
  fprintf(out, "usage: orbmorph %s [options] %s\n%s.\n\n", command->name, command->operands, command->summary);
  for (int id = 0; id < OPT_COUNT; id++) {
    if (command->options & CLI_BIT(id)) {
      help_option(out, id);
    }
  }
  fprintf(out, "\nExample:\n  $ orbmorph %s %s\n", command->name, command->example);
}

void cli_help(FILE *out, const cli_commands *commands) {
  fputs(
      "usage: orbmorph COMMAND [options] …\nMorphs between closed meshes; the daemon orbmorphd computes the morph.\n\n",
      out);
  for (int i = 0; i < commands->count; i++) {
    fprintf(out, "  %-12s %s\n", commands->list[i].name, commands->list[i].summary);
  }
  fputs(
      "\nExamples:\n"
      "  $ orbmorph morph dog.obj giraffe.off --landmarks dog-giraffe.json -o out.glb\n"
      "  $ orbmorph view out.glb --frames 60 -o out.png\n"
      "  $ orbmorph doctor scan.stl\n"
      "  $ orbmorph studio\n"
      "\n'orbmorph COMMAND --help' lists the options of a command; 'orbmorph --version' prints the version.\n"
      "Environment: ORBMORPH_SERVER (address of the daemon), ORBMORPH_TOKEN (token, if the daemon requires one).\n"
      "Exit status: 0 success, 1 refused by the daemon or failed job, 2 usage or file error, 3 daemon unreachable.\n",
      out);
}
