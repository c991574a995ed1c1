/* Requests whose line or headers libmicrohttpd cannot take apart or answer. */
#ifndef ORB_HTTP_TARGET_H
#define ORB_HTTP_TARGET_H

#include <microhttpd.h>

/* Memory of a connection: what arrives before the body, a record of each parameter and header, and the head of the
 * answer. */
enum { TARGET_MEMORY = 16 * 1024 };
/* Of a query; and of a target, with 64 bytes for each parameter. */
enum { TARGET_PARAMETERS = 128, TARGET_BYTES = 10 * 1024 };

/* When the memory of a connection is full, libmicrohttpd closes it or waits, without an answer. So this function
 * answers two requests before libmicrohttpd gets that far: one whose target would fill the memory (414), and one whose
 * headers leave no room for an answer (431). It writes to the socket or the TLS session past the library. 1: it refused
 * the request, and nothing may follow on the connection. */
int target_refused(const char *target, const char *number, struct MHD_Connection *connection);
/* Answers 503: there is no memory for a copy of the target. Nothing may follow on the connection. */
void target_lacks_room(const char *number, struct MHD_Connection *connection);
/* Call it once, when the headers have arrived. */
int target_headers_refused(const char *number, struct MHD_Connection *connection);

#endif
