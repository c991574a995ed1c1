/* Compressed answers in memory, of what never changes: descriptions, pages, assets and spheres, by their strong ETag.
 * Each is compressed once; the least recently sent are dropped first. Any thread may use it. */
#ifndef ORB_HTTP_ENCODED_H
#define ORB_HTTP_ENCODED_H

#include "http/encode.h"

typedef struct encoded_cache encoded_cache;
typedef struct encoded {
  void *bytes; /* NULL: compressing does not make it smaller */
  size_t size;
} encoded;

encoded_cache *encoded_open(size_t max_bytes); /* NULL: out of memory */
void encoded_close(encoded_cache *c);          /* all references must have been released */
/* Adds a reference; NULL: not there. */
const encoded *encoded_find(encoded_cache *c, const char *tag, coding which);
/* Compresses what is not there yet, and adds a reference; NULL: out of memory. */
const encoded *encoded_make(encoded_cache *c, const char *tag, coding which, const void *bytes, size_t size);
void encoded_release(const encoded *e); /* NULL: nothing */

#endif
