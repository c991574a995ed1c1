/* orbmorph: the command line over HTTP. What its files share. */
#ifndef ORB_CLI_H
#define ORB_CLI_H

#include <cjson/cJSON.h>
#include <curl/curl.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#define CLI_VERSION "1.0.0"
#define CLI_DEFAULT_SERVER "http://127.0.0.1:8080"

/* Exit statuses. */
enum { CLI_DONE = 0, CLI_REFUSED = 1, CLI_USAGE = 2, CLI_UNREACHABLE = 3 };

/* Options: one list for all commands; a command names those it takes by a set of bits. */
typedef enum cli_option_id {
  OPT_SERVER,
  OPT_JSON,
  OPT_QUIET,
  OPT_HELP,
  OPT_OUTPUT,
  OPT_REPORT,
  OPT_LANDMARKS,
  OPT_ALIGN,
  OPT_REMESH,
  OPT_TOLERANCE,
  OPT_MAX_TRIANGLES,
  OPT_NO_NORMALS,
  OPT_ANIMATION,
  OPT_FIT,
  OPT_PATH,
  OPT_SET,
  OPT_NO_WAIT,
  OPT_NAME,
  OPT_REPAIR,
  OPT_FORMAT,
  OPT_METHOD,
  OPT_PRESET,
  OPT_WAIT,
  OPT_CANCEL,
  OPT_STATE,
  OPT_LIMIT,
  OPT_PART,
  OPT_POSES,
  OPT_SIZE,
  OPT_UP,
  OPT_YAW,
  OPT_PITCH,
  OPT_WIRE,
  OPT_INSIDE,
  OPT_FRAMES,
  OPT_COUNT
} cli_option_id;

#define CLI_BIT(id) (UINT64_C(1) << (id))
#define CLI_COMMON (CLI_BIT(OPT_SERVER) | CLI_BIT(OPT_JSON) | CLI_BIT(OPT_QUIET) | CLI_BIT(OPT_HELP))

typedef struct cli_option {
  const char *name;    /* without the dashes */
  char letter;         /* 0: none */
  const char *value;   /* what stands for its value in the help; NULL: a switch */
  const char *choices; /* for completion, separated by blanks; NULL: free */
  const char *help;
} cli_option;
extern const cli_option cli_options[OPT_COUNT];

enum { CLI_SETS_MAX = 64 };

/* A parsed command line. Strings are borrowed from argv, except operands that a pattern expanded to. */
typedef struct cli_args {
  const char *value[OPT_COUNT]; /* NULL: not given; switches: "" */
  const char *sets[CLI_SETS_MAX];
  int set_count;
  char **operands;
  int operand_count;
} cli_args;

typedef struct cli {
  const char *server, *token;
  int json, quiet, bar;       /* bar: progress is drawn on a terminal */
  int bar_drawn, bar_percent; /* what stands there now */
  char bar_label[32];
  CURL *curl;
  cli_args args;
} cli;

typedef struct cli_command {
  const char *name, *operands, *summary;
  int least, most; /* operands; most −1: any number */
  uint64_t options;
  int (*run)(cli *c);
} cli_command;
extern const cli_command cli_commands[];
extern const int cli_command_count;

/* options.c */
/* Fills args from argv[first…]; CLI_DONE or CLI_USAGE, having said why. Operands that are patterns are expanded. */
int cli_parse(const cli_command *command, int argc, char **argv, int first, cli_args *out);
void cli_args_free(cli_args *args);
void cli_help(FILE *out, const cli_command *command); /* NULL: of the program */

/* text.c */
void *cli_alloc(size_t size); /* zeroed; ends the program without memory */
char *cli_text(const char *format, ...) __attribute__((format(printf, 1, 2)));
char *cli_escape(const char *text);                  /* for a query */
char *cli_read_file(const char *path, size_t *size); /* NULL, having said why */
char *cli_base_name(const char *path);               /* the file's name without folder and ending */
int cli_is_id(const char *text);                     /* 64 hexadecimal digits */
void cli_error(const cli *c, const char *format, ...) __attribute__((format(printf, 2, 3)));
void cli_note(const cli *c, const char *format, ...) __attribute__((format(printf, 2, 3))); /* unless quiet */
const char *cli_string(const cJSON *object, const char *name, const char *otherwise);
double cli_number(const cJSON *object, const char *name); /* NaN where there is none */
void cli_count(double value, char out[32]);               /* 12345 → 12,345 */
int cli_whole_number(const char *text, long least, long most, long *out);
int cli_decimal(const char *text, double *out);

/* http.c */
typedef struct cli_reply {
  long status; /* 0: no answer */
  char *body;  /* zero-terminated; NULL where it went to a file */
  size_t size;
  char *location;
  long retry_after; /* −1: none */
  cJSON *json;      /* of the body where it is JSON */
} cli_reply;

typedef struct cli_request {
  const char *method, *path; /* path from the slash after the authority */
  const char *json;          /* a body, or NULL */
  FILE *upload;              /* a body streamed from a file, or NULL */
  curl_off_t upload_size;
  FILE *download;    /* where a 2xx body goes, or NULL: into the reply */
  const char *label; /* for the progress bar of a transfer */
  int patient;       /* wait for a daemon that is away, for a while */
} cli_request;

/* Sends and receives. CLI_DONE whatever the status of the answer, or CLI_UNREACHABLE, having said why. Waits and
 * repeats where the daemon asks for that by Retry-After. Free the reply in both cases. */
int cli_send(cli *c, const cli_request *request, cli_reply *out);
int cli_get(cli *c, const char *path, cli_reply *out);
void cli_reply_free(cli_reply *reply);
int cli_ok(const cli_reply *reply); /* 2xx */

/* problem.c */
/* Says what the daemon refused; subject NULL: nothing in particular. Always CLI_REFUSED. */
int cli_refused(cli *c, const char *subject, const cli_reply *reply);
int cli_problem(cli *c, const char *subject, const cJSON *problem);
/* What an owner of a mesh can do about a problem of this type; NULL: nothing is known. */
const char *cli_advice(const char *type);
const char *cli_problem_type(const cJSON *problem); /* "not-closed" */

/* progress.c */
void cli_bar(cli *c, const char *label, double fraction);
void cli_bar_end(cli *c);
/* Waits for the end of a job, given as the daemon's JSON; *result (to free) is the path of what it made. */
int cli_wait(cli *c, const cJSON *job, char **result);

/* mesh.c */
typedef struct cli_mesh {
  char *id, *name;
} cli_mesh;
/* An id stands for itself; a file is uploaded. */
int cli_mesh_of(cli *c, const char *operand, cli_mesh *out);
void cli_mesh_free(cli_mesh *mesh);
/* Uploads a file and leaves the answer in reply, whatever its status. */
int cli_upload(cli *c, const char *path, const char *name, const char *repair, cli_reply *reply);

/* report.c */
void cli_print_mesh(const cJSON *mesh);
void cli_print_embedding(const cJSON *embedding);
void cli_print_supermesh(const cJSON *supermesh);
/* Markdown where the path ends in .md, else the daemon's JSON. CLI_DONE or CLI_USAGE, having said why. */
int cli_write_report(cli *c, const char *path, const cli_reply *supermesh);

/* Streams a resource into a file ("-": standard output), by way of a temporary one beside it. */
int cli_download(cli *c, const char *path, const char *file);

/* The commands. */
int cli_run_morph(cli *c);
int cli_run_merge(cli *c);
int cli_run_upload(cli *c);
int cli_run_embed(cli *c);
int cli_run_job(cli *c);
int cli_run_ls(cli *c);
int cli_run_get(cli *c);
int cli_run_rm(cli *c);
int cli_run_doctor(cli *c);
int cli_run_view(cli *c);
int cli_run_completions(cli *c);

#endif
