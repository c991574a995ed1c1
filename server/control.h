/* The control socket: a Unix socket in the data folder through which `orbmorphd token` and `orbmorphd key` reach a
 * running daemon. Only the daemon's user and root may use it. A client sends one line; the daemon replies with a digit,
 * the exit status, then text, and closes the connection.
 */
#ifndef ORB_CONTROL_H
#define ORB_CONTROL_H

#include <sys/types.h>

#include "api/text.h"

/* who: the user of the client's process, which the kernel tells. Returns the exit status. */
typedef int (*control_handler)(void *user, const char *line, uid_t who, api_text *reply);

/* The caller holds the lock of the data folder. Returns the descriptor, or −1 with the reason logged. */
int control_listen(const char *data);
void control_close(const char *data, int fd);
/* Serves one waiting connection, if any. */
void control_serve(int fd, control_handler handle, void *user);

/* Sends a line to the daemon that serves the folder. Returns the exit status, or −1 if no daemon listens. */
int control_ask(const char *data, const char *line, api_text *reply);

#endif
