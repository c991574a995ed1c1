/* Answers that never change, kept in memory by their strong ETag: compressed descriptions, pages, assets and spheres,
 * and small assets as they are. Each is compressed once; the least recently sent are dropped first. Any thread may use
 * it.
 */
#ifndef ORB_HTTP_ENCODED_H
#define ORB_HTTP_ENCODED_H

#include "http/encode.h"
#include "http/held.h"

typedef struct encoded_cache encoded_cache;
typedef struct encoded {
  void *bytes; /* NULL: compressing does not make it smaller, or it is too large to be kept as it is */
  size_t size;
} encoded;

/* budget: counts their bytes as long as a caller or the cache has them, and lets the cache give way; NULL: none. NULL:
 * out of memory. */
encoded_cache *encoded_open(size_t max_bytes, held *budget);
void encoded_close(encoded_cache *c); /* all references must have been released */
/* Adds a reference; NULL: not there. */
const encoded *encoded_find(encoded_cache *c, const char *tag, coding which);
/* Compresses what is not there yet, or copies it for CODING_NONE, and adds a reference; NULL: no memory. bytes
 * NULL: remembers that this answer is not kept. */
const encoded *encoded_make(encoded_cache *c, const char *tag, coding which, const void *bytes, size_t size);
void encoded_release(const encoded *e); /* NULL: nothing */

#endif
