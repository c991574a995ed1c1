/* The inside of a context: only the files of core/base look in. */
#ifndef ORB_BASE_STATE_H
#define ORB_BASE_STATE_H

#include <pthread.h>
#include <stdatomic.h>

#include "orbmorph/context.h"

struct orb_context {
  uint32_t magic;
  orb_context *root; /* itself, or the context of which this one is a part: it has budget, cancel flag and progress */
  orb_context_options options;
  atomic_int cancelled;
  atomic_size_t memory_used, memory_peak; /* bytes */
  atomic_size_t heap_used, heap_held;     /* of memory_used, what malloc() serves, and the most since it gave back */
  pthread_mutex_t error_lock;             /* guards error while a parallel loop runs */
  orb_error error;
  int in_loop; /* set by orb_parallel_for() around a loop: the first failure wins */
  pthread_mutex_t progress_lock;
  const char *stage;     /* the only stage that is reported; NULL: any */
  double steps_expected; /* of that stage; 0: its steps are not counted */
  atomic_llong steps;    /* made so far */
  double steps_shown;    /* as the fraction that was last reported */
  struct orb_pool *pool; /* created by the first parallel loop, or by orb_pool_open() */
  uint64_t hash_key[2];  /* of orb_hash() */
};

#endif
