/* Descriptions of meshes, embeddings and supermeshes that were asked for lately, so that handlers answer from memory.
 * Any thread. Entries are immutable and counted; the least recently used leave first. */
#ifndef ORB_CACHE_H
#define ORB_CACHE_H

#include "store/catalogue.h"

typedef struct cache cache;
typedef struct cached {
  resource row;
  char tenant[64]; /* as this owner sees it; "": as the first one described it */
  size_t json_size;
  char etag[40]; /* of the description, with quotes */
} cached;

cache *cache_create(size_t max_bytes);
void cache_destroy(cache *c);
/* Referenced; NULL if not there. */
const cached *cache_find(cache *c, resource_kind kind, const char *id, const char *tenant);
/* How many were dropped so far. A row that was read before a drop may be of what is gone since. */
unsigned long long cache_drops(cache *c);
/* Takes row->json over; referenced. Kept only if nothing was dropped since the row was read: `since` is what
 * cache_drops() was before. NULL out of memory (json freed). */
const cached *cache_add(cache *c, resource *row, const char *tenant, unsigned long long since);
/* 1 where the last use that was noted is a second ago or more; then this one is noted. now: orb_clock_ms(). */
int cache_note_use(cache *c, const cached *entry, int64_t now);
void cache_release(cache *c, const cached *entry);
void cache_drop(cache *c, resource_kind kind, const char *id); /* for all tenants */

#endif
