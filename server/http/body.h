/* Bodies of requests: undone of their content coding, bounded in size, ratio and memory, handed to their reader. */
#ifndef ORB_HTTP_BODY_H
#define ORB_HTTP_BODY_H

#include "http/http.h"

/* Once the headers are found good; may leave a refusal. */
void body_begin(request *r);
/* The next bytes as they came. After a refusal the rest is dropped, up to a bound: 0 where that is reached and the
 * connection is to end, with the refusal written to it as far as that is possible. */
int body_take(request *r, const char *bytes, size_t size);
/* All came: 0 with a refusal where the coding says that something is missing. */
int body_end(request *r);
void body_free(request *r);

#endif
