/* Eviction: deletes derived objects (embeddings, alignments, supermeshes) beyond a budget, least recently used first.
 * Never deletes uploads. */
#ifndef ORB_EVICT_H
#define ORB_EVICT_H

#include "cache.h"
#include "queue/queue.h"

typedef struct evict_env {
  catalogue *cat;
  objects *store;
  cache *descriptions; /* NULL: none */
  queue *q;            /* NULL: no jobs; else embeddings whose mesh an unfinished job needs are kept */
} evict_env;

/* Deletes derived objects until at most `budget` bytes are left, but none that was used since `before` (Unix time in
 * ms). Returns the bytes that are left. Blocks for commits. */
int64_t evict_derived(const evict_env *env, int64_t budget, int64_t before);

/* Deletes a resource: row, cached description and objects. */
store_result evict_one(const evict_env *env, resource_kind kind, const char *id);
/* Ends a tenant's ownership; deletes the resource if it was the last owner. STORE_NOT_FOUND: it does not own it. */
store_result evict_owned(const evict_env *env, resource_kind kind, const char *id, const char *tenant);

/* Deletes the resource whose object was moved to quarantine, if a job can make it again: the next request does. */
void evict_damaged(const evict_env *env, object_kind kind, const char *id);

/* Whether a row names this object; also if that cannot be read. */
int evict_is_named(catalogue *cat, object_kind kind, const char *id);
/* Deletes a published object that got no row, unless there is one now. Not within objects_hold(). */
void evict_unnamed(catalogue *cat, objects *store, object_kind kind, const char *id);
/* Deletes the files that had to stay while a backup ran; does nothing while one runs. Blocks. */
void evict_held(const evict_env *env);

#endif
