/* Options and commands: the tables from which the parser, the help and the completions are made. */
#ifndef ORB_CLI_OPTIONS_H
#define ORB_CLI_OPTIONS_H

#include <stdint.h>
#include <stdio.h>

/* All commands share one list of options; a command names the options it takes by a set of bits. */
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
  OPT_TRANSFER,
  OPT_SET,
  OPT_NO_WAIT,
  OPT_NAME,
  OPT_REPAIR,
  OPT_HANDLE_SIZE,
  OPT_TAKE_PART,
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
  OPT_KEY,
  OPT_EXPIRES,
  OPT_PROFILE,
  OPT_DATA,
  OPT_NO_OPEN,
  OPT_COUNT
} cli_option_id;

#define CLI_BIT(id) (UINT64_C(1) << (id))

typedef struct cli_option {
  const char *name;    /* without the dashes */
  char letter;         /* 0: no short form */
  const char *value;   /* the placeholder of its value in the help; NULL: a switch */
  const char *choices; /* the values that completion offers, separated by blanks; NULL: any */
  const char *help;
} cli_option;
extern const cli_option cli_options[OPT_COUNT];

struct cli;
typedef struct cli_command {
  const char *name, *operands, *summary;
  int least, most; /* number of operands; most −1: no limit */
  uint64_t options;
  const char *words;   /* the operands that completion offers, separated by blanks; NULL: files */
  const char *example; /* arguments, for the help */
  int (*run)(struct cli *c);
} cli_command;

typedef struct cli_commands {
  const cli_command *list;
  int count;
} cli_commands;

enum { CLI_SETS_MAX = 64 };

/* A parsed command line. Values are borrowed from argv; operands are copies. */
typedef struct cli_args {
  const char *value[OPT_COUNT]; /* NULL: not given; a switch: "" */
  const char *sets[CLI_SETS_MAX];
  int set_count;
  const char **parts; /* every --take-part */
  int part_count;
  char **operands;
  int operand_count;
} cli_args;

/* Parses argv[first…] into args and expands operands that are patterns. Returns CLI_DONE, or CLI_USAGE after printing
 * the error. The caller frees args in both cases. */
int cli_parse(const cli_command *command, int argc, char **argv, int first, cli_args *args);
void cli_args_free(cli_args *args);

/* Whether an argument that begins with - is an option of any command. */
int cli_knows_option(const char *text);

void cli_help(FILE *out, const cli_commands *commands);
void cli_help_command(FILE *out, const cli_command *command);

#endif
