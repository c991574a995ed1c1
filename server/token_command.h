/* `orbmorphd token add|list|remove`: the operator's side of tokens. */
#ifndef ORB_TOKEN_COMMAND_H
#define ORB_TOKEN_COMMAND_H

#include "config.h"

typedef struct token_command {
  enum { TOKEN_ADD, TOKEN_LIST, TOKEN_REMOVE } verb;
  const char *name;
  int scopes;
  int64_t quota;
} token_command;

/* Takes its own words out of argv (which begins with the program and "token") and leaves the program and the options
 * of the daemon; *argc becomes their number. 0 with the reason on standard error. */
int token_command_read(token_command *out, int *argc, char **argv);
/* With the data folder locked. The exit status. */
int token_command_run(const token_command *command, const config *options);

#endif
