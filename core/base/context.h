/* The inside of a context; only the files of core/base look in. */
#ifndef ORB_BASE_CONTEXT_H
#define ORB_BASE_CONTEXT_H

#include <pthread.h>
#include <stdatomic.h>

#include "orbmorph/context.h"

typedef struct orb_pool orb_pool;

struct orb_context {
  uint32_t magic;
  orb_context_options options;
  atomic_int cancelled;
  atomic_size_t memory_used, memory_peak;
  pthread_mutex_t error_lock; /* guards error while a parallel loop runs */
  orb_error error;
  int in_loop; /* set by orb_parallel_for() around a loop: the first failure wins */
  pthread_mutex_t progress_lock;
  const char *stage; /* the only one that is reported; NULL: any */
  orb_pool *pool;    /* made by the first parallel loop */
};

void orb_pool_stop(orb_context *ctx);
int64_t orb_context_max_triangles(const orb_context *ctx);

#endif
