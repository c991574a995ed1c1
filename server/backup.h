/* `orbmorphd backup DIR`: the data folder as of one moment, also while a daemon serves it. `orbmorphd restore DIR`: a
 * new data folder from that.
 *
 * A backup is laid out like a data folder: catalogue.sqlite and objects, and a file `backup` that marks it. While a
 * backup runs it holds the lock of objects_backup_lock(), so no object that its catalogue names is deleted. Objects
 * come first, then the catalogue is replaced, then objects that it does not name are deleted: at each moment the folder
 * is the previous backup or the new one, so a backup may be killed.
 */
#ifndef ORB_BACKUP_H
#define ORB_BACKUP_H

#include "config.h"

typedef struct backup_command {
  int (*run)(const char *folder, const config *options); /* NULL: none; returns the exit status */
  const char *folder;
} backup_command;

/* Takes "backup DIR" or "restore DIR" out of argv. 0 if DIR is missing, with the reason on standard error. */
int backup_command_read(backup_command *out, int *argc, char **argv);

#endif
