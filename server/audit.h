/* What the audit log says of commands: the kind, the verb and the name, who made it, and whether it failed.
 *
 * The audit log is lines of the daemon's log. A command that runs while no daemon does has no such log, so it leaves
 * its line in a file of the data folder, and the next daemon moves the lines of that file to its log, with the member
 * `without_daemon`. The callers of functions with `data` hold the lock of the data folder.
 */
#ifndef ORB_AUDIT_H
#define ORB_AUDIT_H

#include <sys/types.h>

/* who: the user of the process that gave the command. */
void audit_log(uid_t who, const char *message);

/* Opens the file, before the command is executed: one that would leave no record must not be. Returns the descriptor,
 * or −1 with the reason logged. */
int audit_open(const char *data);
/* Appends a line about a command of this process, and closes the file. 0 with the reason logged. */
int audit_keep(int file, const char *message);
/* Moves the lines of the file to the log, and deletes it. */
void audit_bring(const char *data);

#endif
