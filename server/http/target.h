/* Targets of request lines that libmicrohttpd cannot take apart. */
#ifndef ORB_HTTP_TARGET_H
#define ORB_HTTP_TARGET_H

#include <microhttpd.h>

enum { TARGET_PARAMETERS = 128 }; /* of a query */

/* libmicrohttpd keeps each parameter of a query in the memory of the connection, and when that is full it closes the
 * connection without an answer. So a target with more than TARGET_PARAMETERS is answered before it is taken apart, with
 * 414 written to the socket past the library; over TLS the connection closes without a response. 1: it was refused, and
 * nothing may follow on the connection. */
int target_refused(const char *target, const char *number, int tls, struct MHD_Connection *connection);

#endif
