/* The head of an answer that libmicrohttpd writes twice.
 *
 * libmicrohttpd 0.9.75 answers a request that it cannot read itself (a Content-Length that is not a number, for one),
 * and writes the head of such an answer twice, then the body. Behind a proxy the second head may be taken for the next
 * caller's answer. The daemon cannot answer such a request itself, so it suppresses the second head: without TLS in
 * sendmsg() (regions.h), with TLS in a gnutls_record_send() of its own, which the program's libraries call in place of
 * GnuTLS's. */
#ifndef ORB_HTTP_TWIN_H
#define ORB_HTTP_TWIN_H

#include <stddef.h>

/* The length of the first of two heads that are all of these bytes; 0: they are something else. The two may differ in
 * their Date: libmicrohttpd asks for the time before each, and a second may end between them. */
size_t twin_head(const void *bytes, size_t size);

#endif
