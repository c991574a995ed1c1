/* `orbmorphd backup DIR`: copies the data folder as it is at one moment, even while a daemon serves it. `orbmorphd
 * restore DIR`: makes a new data folder from that copy.
 *
 * A backup is laid out like a data folder: catalogue.sqlite and objects, and a file `backup` that marks it. A
 * backup holds the lock of objects_backup_lock() while it runs, so the daemon deletes no object that the copied
 * catalogue names. It copies objects first, then replaces the catalogue, then deletes objects that the new catalogue
 * does not name. So the folder is always a complete backup, the previous or the new one, and the process may be killed
 * at any time.
 *
 * A restore locks the folder, makes catalogue.new, and renames it to catalogue.sqlite last. Until then daemons and
 * all commands refuse the folder (store/place.h), and another restore goes on with it.
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
