/* `orbmorphd token add|set|list|remove`: managing tokens.
 *
 * A command is one line of text. The process that holds the data folder executes it: a running daemon, through its
 * control socket, or else this process. A running daemon applies the change from the next request on.
 */
#ifndef ORB_TOKEN_COMMAND_H
#define ORB_TOKEN_COMMAND_H

#include "config.h"
#include "store/tokens.h"

typedef struct token_command {
  const char *verb, *name, *tenant; /* tenant: NULL if not given */
  int scopes;                       /* scopes and the numbers: −1 if not given */
  int64_t quota, jobs, priority;
} token_command;

/* Removes the command's own words from argv (which begins with the program and "token"); the program and the options of
 * the daemon stay, and *argc becomes their number. 0 with the reason on standard error. */
int token_command_read(token_command *out, int *argc, char **argv);
/* Sends the command to a running daemon. Returns the exit status; −1 if no daemon answers. */
int token_command_ask(const token_command *command, const config *options);
/* Executes the command in this process, which holds the lock of the data folder. Returns the exit status. */
int token_command_run(const token_command *command, const config *options);
/* Executes a line. Returns the exit status, with the text to show in *reply. */
int token_command_apply(catalogue *cat, const char *line, api_text *reply);

#endif
