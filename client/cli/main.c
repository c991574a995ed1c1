/* orbmorph: the command-line client. The daemon does the work; the client only speaks HTTP. */
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "commands.h"
#include "terminal.h"
#include "text.h"

#define CLI_REPAIRS (CLI_BIT(OPT_REPAIR) | CLI_BIT(OPT_HANDLE_SIZE) | CLI_BIT(OPT_TAKE_PART))
#define COMMON_OPTIONS (CLI_BIT(OPT_SERVER) | CLI_BIT(OPT_JSON) | CLI_BIT(OPT_QUIET) | CLI_BIT(OPT_HELP))
#define MERGE_OPTIONS                                                                                         \
  (COMMON_OPTIONS | CLI_BIT(OPT_OUTPUT) | CLI_BIT(OPT_REPORT) | CLI_BIT(OPT_LANDMARKS) | CLI_BIT(OPT_ALIGN) | \
   CLI_BIT(OPT_REMESH) | CLI_BIT(OPT_TOLERANCE) | CLI_BIT(OPT_MAX_TRIANGLES) | CLI_BIT(OPT_NO_NORMALS) |      \
   CLI_BIT(OPT_ANIMATION) | CLI_BIT(OPT_FIT) | CLI_BIT(OPT_PATH) | CLI_BIT(OPT_TRANSFER) | CLI_BIT(OPT_SET) | \
   CLI_BIT(OPT_NO_WAIT) | CLI_REPAIRS | CLI_BIT(OPT_PROFILE))

static const cli_command command_list[] = {
    {"morph", "FILE FILE…", "Upload meshes, merge them and download a GLB that morphs between them", 2, -1,
     MERGE_OPTIONS, NULL, "dog.obj giraffe.off --landmarks dog-giraffe.json -o out.glb", cli_run_morph},
    {"upload", "FILE|URL…", "Upload meshes; the daemon fetches URLs", 1, -1,
     COMMON_OPTIONS | CLI_BIT(OPT_NAME) | CLI_REPAIRS | CLI_BIT(OPT_FORMAT), NULL, "--repair fill_holes scan.stl",
     cli_run_upload},
    {"embed", "MESH…", "Embed meshes (ids, files or URLs) on the sphere", 1, -1,
     COMMON_OPTIONS | CLI_BIT(OPT_METHOD) | CLI_BIT(OPT_PRESET) | CLI_BIT(OPT_SET) | CLI_BIT(OPT_OUTPUT) |
         CLI_BIT(OPT_NO_WAIT) | CLI_REPAIRS,
     NULL, "dog.obj --preset quality -o sphere.ply", cli_run_embed},
    {"merge", "MESH MESH…", "Merge meshes (ids, files or URLs); with -o, also download the GLB", 2, -1, MERGE_OPTIONS,
     NULL, "--tolerance 0.0005 -o walk.glb 'frames/*.ply'", cli_run_merge},
    {"job", "ID", "Show a job, wait for it or cancel it", 1, 1,
     COMMON_OPTIONS | CLI_BIT(OPT_WAIT) | CLI_BIT(OPT_CANCEL), NULL, "--wait /v1/jobs/ID", cli_run_job},
    {"ls", "[meshes|embeddings|supermeshes|jobs]", "List meshes, embeddings, supermeshes or jobs", 0, 1,
     COMMON_OPTIONS | CLI_BIT(OPT_STATE) | CLI_BIT(OPT_LIMIT), "meshes embeddings supermeshes jobs",
     "jobs --state running", cli_run_ls},
    {"get", "ID|PATH", "Show a resource, or download its data", 1, 1,
     COMMON_OPTIONS | CLI_BIT(OPT_OUTPUT) | CLI_BIT(OPT_PART) | CLI_BIT(OPT_PROFILE), NULL,
     "/v1/supermeshes/ID --part asset -o out.glb", cli_run_get},
    {"rm", "ID|PATH…", "Delete resources", 1, -1, COMMON_OPTIONS, NULL, "/v1/supermeshes/ID", cli_run_rm},
    {"usage", "", "Show what your tenant stores and runs; with the scope admin, all tenants", 0, 0,
     COMMON_OPTIONS | CLI_BIT(OPT_LIMIT), NULL, "--json", cli_run_usage},
    {"doctor", "FILE…", "Check meshes and suggest repairs", 1, -1, COMMON_OPTIONS, NULL, "scan.stl", cli_run_doctor},
    {"view", "FILE.glb", "Draw poses of a morph into a PNG file, without the daemon", 1, 1,
     CLI_BIT(OPT_HELP) | CLI_BIT(OPT_QUIET) | CLI_BIT(OPT_OUTPUT) | CLI_BIT(OPT_POSES) | CLI_BIT(OPT_SIZE) |
         CLI_BIT(OPT_UP) | CLI_BIT(OPT_YAW) | CLI_BIT(OPT_PITCH) | CLI_BIT(OPT_WIRE) | CLI_BIT(OPT_INSIDE) |
         CLI_BIT(OPT_FRAMES),
     NULL, "out.glb --frames 60 -o out.png", cli_run_view},
    {"sign", "URL", "Sign the URL of a morph, so that a browser can load it without a token", 1, 1,
     CLI_BIT(OPT_HELP) | CLI_BIT(OPT_KEY) | CLI_BIT(OPT_EXPIRES), NULL,
     "'https://morph.example.org/v1/morph.glb?shapes=ID,ID' --expires 30d", cli_run_sign},
    {"studio", "[FILE…]", "Start a daemon on a free port and open the studio in the browser", 0, -1,
     CLI_BIT(OPT_HELP) | CLI_BIT(OPT_QUIET) | CLI_BIT(OPT_DATA) | CLI_BIT(OPT_NO_OPEN) | CLI_REPAIRS, NULL,
     "dog.obj giraffe.off", cli_run_studio},
    {"completions", "bash|zsh|fish", "Print the completion script of a shell", 1, 1, CLI_BIT(OPT_HELP), "bash zsh fish",
     "bash > /etc/bash_completion.d/orbmorph", cli_run_completions},
};
static const cli_commands commands = {command_list, sizeof command_list / sizeof command_list[0]};

static const cli_command *find_command(const char *name) {
  for (int i = 0; i < commands.count; i++) {
    if (!strcmp(commands.list[i].name, name)) {
      return &commands.list[i];
    }
  }
  return NULL;
}

static const char *setting(const char *given, const char *variable, const char *otherwise) {
  const char *value = given ? given : getenv(variable);
  return value && *value ? value : otherwise;
}

static int run(const cli_command *command, cli *c) {
  const char *term = getenv("TERM");
  c->server = setting(c->args.value[OPT_SERVER], "ORBMORPH_SERVER", CLI_DEFAULT_SERVER);
  c->token = setting(NULL, "ORBMORPH_TOKEN", NULL);
  c->json = c->args.value[OPT_JSON] != NULL;
  c->quiet = c->args.value[OPT_QUIET] != NULL;
  c->bar = !c->quiet && isatty(STDERR_FILENO) && term && strcmp(term, "dumb") != 0;
  if (curl_global_init(CURL_GLOBAL_DEFAULT) != 0 || !(c->curl = curl_easy_init())) {
    fputs("orbmorph: cannot initialize libcurl\n", stderr);
    return CLI_UNREACHABLE;
  }
  int rc = command->run(c);
  cli_bar_end(c);
  curl_easy_cleanup(c->curl);
  curl_global_cleanup();
  if (fflush(stdout) != 0 && rc == CLI_DONE) {
    perror("orbmorph: standard output");
    rc = CLI_USAGE;
  }
  return rc;
}

/* Options may also precede the command: returns argv with the command first. *at: there is a command. */
static char **command_first(int argc, char **argv, int *at) {
  int i = 1;
  while (i < argc && argv[i][0] == '-') {
    i += !strcmp(argv[i], "--server") || !strcmp(argv[i], "-s") ? 2 : 1;
  }
  char **line = cli_alloc((size_t)(argc + 1) * sizeof *line);
  int fill = 0;
  line[fill++] = argv[0];
  if (i < argc) {
    line[fill++] = argv[i];
  }
  for (int k = 1; k < argc; k++) {
    if (k != i) {
      line[fill++] = argv[k];
    }
  }
  *at = i < argc;
  return line;
}

/* Says why a command line names no command that exists. */
static void refuse_line(char **argv, const char *command) {
  const char *unknown = NULL;
  for (int i = 1; !command && !unknown && argv[i] && argv[i][0] == '-'; i++) {
    unknown = cli_knows_option(argv[i]) ? NULL : argv[i];
  }
  if (command || unknown) {
    fprintf(stderr, "orbmorph: unknown %s '%s'\n", command ? "command" : "option", command ? command : unknown);
  }
  cli_help(stderr, &commands);
}

int main(int argc, char **argv) {
  if (argc == 2 && (!strcmp(argv[1], "--version") || !strcmp(argv[1], "version"))) {
    puts("orbmorph " CLI_VERSION);
    return CLI_DONE;
  }
  if (argc >= 2 && (!strcmp(argv[1], "--help") || !strcmp(argv[1], "-h") || !strcmp(argv[1], "help"))) {
    const cli_command *about = argc > 2 ? find_command(argv[2]) : NULL;
    if (about) {
      cli_help_command(stdout, about);
    } else {
      cli_help(stdout, &commands);
    }
    return CLI_DONE;
  }
  int given, rc;
  char **line = command_first(argc, argv, &given);
  const cli_command *command = given ? find_command(line[1]) : NULL;
  cli c = {.commands = commands};
  if (!command) {
    refuse_line(argv, given ? line[1] : NULL);
    rc = CLI_USAGE;
  } else if ((rc = cli_parse(command, argc, line, 2, &c.args)) == CLI_DONE) {
    if (c.args.value[OPT_HELP]) {
      cli_help_command(stdout, command);
    } else {
      rc = run(command, &c);
    }
  }
  cli_args_free(&c.args);
  free(line);
  return rc;
}
