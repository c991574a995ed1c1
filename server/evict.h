/* Eviction: derived objects beyond a budget leave, the least recently used first. Uploads never do. */
#ifndef ORB_EVICT_H
#define ORB_EVICT_H

#include "cache.h"
#include "queue/queue.h"

typedef struct evict_env {
  catalogue *cat;
  objects *store;
  cache *descriptions; /* NULL: none */
  queue *q;            /* NULL: no jobs; else embeddings of meshes that unfinished jobs need stay */
} evict_env;

/* Removes derived objects until at most `budget` bytes are left, but none that was used since `before` (unix time in
 * ms). Returns the bytes that are left. Blocks for commits. */
int64_t evict_derived(const evict_env *env, int64_t budget, int64_t before);

/* Row, description and objects. */
store_result evict_one(const evict_env *env, resource_kind kind, const char *id);
/* What the tenant has of it; all of it where nobody else owns it. STORE_NOT_FOUND: the tenant does not own it. */
store_result evict_owned(const evict_env *env, resource_kind kind, const char *id, const char *tenant);

#endif
