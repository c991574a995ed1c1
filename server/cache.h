/* A cache of recently used descriptions (meshes, embeddings, supermeshes), so that handlers respond from memory. Any
 * thread may use it. Entries are immutable and reference-counted; the least recently used are dropped first. */
#ifndef ORB_CACHE_H
#define ORB_CACHE_H

#include "store/catalogue.h"

typedef struct cache cache;
typedef struct cached {
  resource row;
  char tenant[64]; /* the owner whose view this is; "": the resource's own description */
  size_t json_size;
  char etag[40]; /* of the description, with quotes */
  char *header;  /* __atomic, set once: see cache_keep_header(); NULL: none yet */
} cached;

cache *cache_create(size_t max_bytes);
void cache_destroy(cache *c);
/* Adds a reference; NULL if not cached. */
const cached *cache_find(cache *c, resource_kind kind, const char *id, const char *tenant);
/* The number of calls of cache_drop() so far. A row that was read before a drop may since have been deleted. */
unsigned long long cache_drops(cache *c);
/* Takes ownership of row->json and returns an entry with a reference. The cache keeps the entry only if there was no
 * drop since the row was read: `since` is cache_drops() from before reading. NULL if out of memory (json freed). */
const cached *cache_add(cache *c, resource *row, const char *tenant, unsigned long long since);
/* 1 if the last recorded use is at least a second ago; then records this one. now: orb_clock_ms(). */
int cache_note_use(cache *c, const cached *entry, int64_t now);
void cache_release(cache *c, const cached *entry);
/* Keeps a header that is derived from the description for as long as the entry lives. The first text is kept; returns
 * that, or NULL if out of memory. */
const char *cache_keep_header(const cached *entry, const char *text);
const char *cache_header(const cached *entry);                 /* NULL: none is kept */
void cache_drop(cache *c, resource_kind kind, const char *id); /* for all tenants */
void cache_drop_all(cache *c);

#endif
