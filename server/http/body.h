/* Bodies of requests: removes the content coding, limits size, ratio and memory, and passes the bytes to the handler.
 */
#ifndef ORB_HTTP_BODY_H
#define ORB_HTTP_BODY_H

#include "http/http.h"

/* After the headers were accepted; may leave a refusal. */
void body_begin(request *r);
/* The next bytes as sent. After a refusal the rest is dropped, up to a limit: 0 when it is reached and the connection
 * must close, after an attempt to write the refusal to it. */
int body_take(request *r, const char *bytes, size_t size);
/* The body is complete: 0 with a refusal if the compressed data ends too early. */
int body_end(request *r);
void body_free(request *r);

#endif
