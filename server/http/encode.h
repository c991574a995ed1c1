/* Content codings of answers: which one a client accepts (RFC 9110 section 12.5.3), and compressing. */
#ifndef ORB_HTTP_ENCODE_H
#define ORB_HTTP_ENCODE_H

#include <stddef.h>

#include "http/decode.h"

/* The coding for the lines of Accept-Encoding: zstd or gzip, whichever has the higher weight, zstd if both have the
 * same; CODING_NONE if neither is accepted, or identity has a higher weight. */
coding coding_accepted(const char *const *lines, int count);
/* "gzip", "zstd"; NULL for CODING_NONE. */
const char *coding_name(coding which);
/* Compresses; *out is allocated with malloc(). 0: out of memory, or the result is not smaller. once: for an answer that
 * is sent once, faster and a little larger. */
int encode_bytes(coding which, const void *bytes, size_t size, int once, void **out, size_t *out_size);

#endif
