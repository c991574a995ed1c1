/* A running daemon's ear for its own command line: a Unix socket in the data folder, which only its user can reach.
 * One line asks, one answer ends the connection: a digit for the exit status, then text.
 */
#ifndef ORB_CONTROL_H
#define ORB_CONTROL_H

#include "api/text.h"

typedef int (*control_handler)(void *user, const char *line, api_text *reply); /* the exit status */

/* With the data folder locked. The descriptor; −1 with the reason logged. */
int control_listen(const char *data);
void control_close(const char *data, int fd);
/* Serves one connection that waits, if any. */
void control_serve(int fd, control_handler handle, void *user);

/* Asks the daemon that has the folder. The exit status, or −1 if none listens. */
int control_ask(const char *data, const char *line, api_text *reply);

#endif
