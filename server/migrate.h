/* `orbmorphd migrate`: copies a deployment to another data folder, database and bucket, see store/move.h. No daemon may
 * run on either of them meanwhile. */
#ifndef ORB_MIGRATE_H
#define ORB_MIGRATE_H

#include "config.h"

typedef struct migrate_command {
  const char *data, *catalogue, *objects, *keys; /* of the source; data NULL: another command */
} migrate_command;

/* Takes "migrate" and the options --from-… out of argv. 0 if they are wrong, with the reason on standard error. */
int migrate_command_read(migrate_command *out, int *argc, char **argv);
/* to: the target. Returns the exit status. */
int migrate_run(const migrate_command *command, const config *to);

#endif
