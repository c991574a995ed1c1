/* Commands on what the catalogue holds by name: `orbmorphd token add NAME …`, `orbmorphd key list`.
 *
 * A command is one line of text: kind, verb, name, then a word for each row of the kind's table of flags. The process
 * that holds the data folder executes it: a running daemon, through its control socket, or else this process. A running
 * daemon applies the change from the next request on. Either way the audit log names the command (audit.h).
 *
 * A kind is a table and the function that executes its lines. A new one is a file such as key.c, declared in kinds.h,
 * with a row in `admin_kinds` of main.c.
 */
#ifndef ORB_ADMIN_COMMAND_H
#define ORB_ADMIN_COMMAND_H

#include "api/text.h"
#include "config.h"
#include "store/catalogue.h"

enum { ADMIN_WORD = 512, ADMIN_FLAGS = 9, ADMIN_VERBS = 6, ADMIN_SECRET = 96, ADMIN_TOLD = 600 };

/* The verbs of a kind; in admin_flag, bit n stands for the verb in row n. */
typedef struct admin_verb {
  const char *name; /* at most 7 bytes; NULL ends the table */
  int named;        /* the command takes NAME */
  int shows_secret; /* the command shows the new secret, this one time */
  int makes;        /* the command makes something, so the data folder may be new */
} admin_verb;

typedef struct admin_flag {
  const char *name;     /* "--quota"; ADMIN_SECRET_WORD: no flag, but the place of the secret; NULL ends the table */
  unsigned taken;       /* verbs that take it */
  unsigned needed;      /* verbs that fail without it */
  const char *standard; /* the word if the flag is not given */
  /* Makes the word, without blanks, from the flag's value. The word is "" before the first value, so that a flag may be
   * given repeatedly. 0: the value is not valid. */
  int (*read)(const char *value, char word[ADMIN_WORD]);
  const char *takes; /* the values that it takes, for the message about another one */
} admin_flag;
#define ADMIN_SECRET_WORD ""

typedef struct admin_kind {
  const char *name;   /* "token": the first word of the line */
  const char *usage;  /* lines of the commands */
  int takes_ids;      /* NAME may be an id, which has 64 letters */
  const char *holder; /* the flag that names what verbs without NAME are about; NULL: none */
  admin_verb verbs[ADMIN_VERBS];
  admin_flag flags[ADMIN_FLAGS];
  /* Makes a secret: what is shown, and the word that stands for it in the line. NULL: the kind has none. */
  void (*make_secret)(const char *name, char shown[ADMIN_WORD], char word[ADMIN_SECRET]);
  /* Executes a line. Returns the exit status, with the text to show in *reply. */
  int (*apply)(catalogue *cat, const char *line, api_text *reply);
} admin_kind;

typedef struct admin_command {
  const admin_kind *kind; /* NULL: no such command is given */
  const admin_verb *verb;
  const char *name;                    /* "-": the verb takes none */
  char words[ADMIN_FLAGS][ADMIN_WORD]; /* by flag */
} admin_command;

/* The kind of the name; NULL if there is none. The last kind of the table is NULL. */
const admin_kind *admin_kind_named(const admin_kind *const *kinds, const char *name);

/* Whether the command is about what a data folder has already. */
int admin_command_needs_data(const admin_command *command);

/* Removes the command's own words from argv (which begins with the program and the kind); the program and the options
 * of the daemon stay, and *argc becomes their number. 0 with the reason on standard error. */
int admin_command_read(admin_command *out, const admin_kind *kind, int *argc, char **argv);
/* Sends the command to a running daemon. Returns the exit status; −1 if there is no command or no daemon answers. */
int admin_command_ask(const admin_command *command, const config *options);
/* Executes the command in this process, which holds the lock of the data folder. Returns the exit status. */
int admin_command_run(const admin_command *command, const config *options);

/* What the audit log says of a line: kind, verb, and what it is about, which is its NAME or the word of the kind's
 * `holder`, or "-" if it has neither: "token add: shop, failed". 0: it says nothing of lists. */
int admin_tell(const admin_kind *kind, const char *line, int status, char out[ADMIN_TOLD]);

/* For admin_flag.read. A name has 1 to 63 letters, digits, '-', '_' and '.', and does not begin with '-'. */
int admin_read_name(const char *value, char word[ADMIN_WORD]);
int admin_read_number(const char *value, char word[ADMIN_WORD]);
/* A time in seconds, or in minutes, hours or days with m, h or d; the word is in seconds. */
int admin_read_span(const char *value, char word[ADMIN_WORD]);
#define ADMIN_OVERLAP "604800" /* for which an old secret stays valid: 7 days */

/* For admin_kind.apply: the exit status of a result, and the reason in *reply. `instead` says what to do where the name
 * is taken. */
int admin_answer(store_result result, const admin_kind *kind, const char *name, const char *instead, api_text *reply);

#endif
