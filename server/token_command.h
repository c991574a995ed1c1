/* `orbmorphd token add|set|list|remove`: the operator's side of tokens.
 *
 * The command is one line of text, which the process that has the data folder carries out: this one, or a daemon that
 * runs, through its control socket. There it holds from the next request on.
 */
#ifndef ORB_TOKEN_COMMAND_H
#define ORB_TOKEN_COMMAND_H

#include "config.h"
#include "store/tokens.h"

typedef struct token_command {
  const char *verb, *name, *tenant; /* tenant: NULL where it is not given */
  int scopes;                       /* these are −1 where they are not given */
  int64_t quota, jobs, priority;
} token_command;

/* Takes its own words out of argv (which begins with the program and "token") and leaves the program and the options
 * of the daemon; *argc becomes their number. 0 with the reason on standard error. */
int token_command_read(token_command *out, int *argc, char **argv);
/* Through the daemon that has the data folder. The exit status; −1 if none answers. */
int token_command_ask(const token_command *command, const config *options);
/* With the data folder locked. The exit status. */
int token_command_run(const token_command *command, const config *options);
/* Carries out a line. The exit status, with what is to be shown in *reply. */
int token_command_apply(catalogue *cat, const char *line, api_text *reply);

#endif
