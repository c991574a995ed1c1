/* Parallel loops on the context's own threads.
 *
 * One loop runs at a time; the caller takes part as thread 0. It publishes the loop under the lock: it sets `open` and
 * raises `round`. A worker that sees a new round enters under the lock, if the loop is still open, and counts itself in
 * `inside`; it takes chunks from the atomic counter until none is left, and leaves under the lock. When the counter is
 * spent, the caller closes the loop and waits only for workers that are inside: a worker that is too late to enter (the
 * machine is busy) delays nobody. Workers spin for a short while between loops, then sleep on a condition variable. If
 * some threads cannot be started, the loop runs on the others: results do not depend on how many there are.
 */
#include "base/parallel.h"

#include <stdlib.h>
#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "base/state.h"

enum {
  MAX_WORKERS = 63, /* and the caller: the 64 threads that context.c allows */
  SPINS = 1000      /* pauses before a thread sleeps: waking it costs more than a short wait for the next loop */
};

struct orb_pool {
  pthread_mutex_t lock;
  pthread_cond_t wake, done;
  int workers, stopping;
  int open;          /* the loop may be entered; guarded by the lock */
  atomic_int inside; /* workers in the present loop */
  atomic_uint round;
  orb_loop_fn body;
  void *arg;
  int64_t count, grain;
  atomic_llong next;
  struct worker {
    orb_context *ctx;
    pthread_t thread;
    int index;
  } worker[MAX_WORKERS];
};

static void take_chunks(struct orb_pool *pool, int thread) {
  int64_t begin;
  while ((begin = atomic_fetch_add_explicit(&pool->next, pool->grain, memory_order_relaxed)) < pool->count) {
    int64_t end = begin + pool->grain < pool->count ? begin + pool->grain : pool->count;
    pool->body(pool->arg, begin, end, thread);
  }
}

static void pause_cpu(void) {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  __asm__ volatile("yield");
#endif
}

static void *worker_main(void *argument) {
  struct worker *self = argument;
  struct orb_pool *pool = self->ctx->pool;
  unsigned seen = 0;
  for (;;) {
    for (int spin = 0; spin < SPINS && atomic_load_explicit(&pool->round, memory_order_acquire) == seen; spin++) {
      pause_cpu();
    }
    pthread_mutex_lock(&pool->lock);
    while (atomic_load_explicit(&pool->round, memory_order_acquire) == seen && !pool->stopping) {
      pthread_cond_wait(&pool->wake, &pool->lock);
    }
    int stop = pool->stopping, enter = pool->open;
    seen = atomic_load(&pool->round);
    if (enter) {
      atomic_fetch_add(&pool->inside, 1);
    }
    pthread_mutex_unlock(&pool->lock);
    if (stop) {
      return NULL;
    }
    if (enter) {
      take_chunks(pool, self->index);
      pthread_mutex_lock(&pool->lock);
      if (atomic_fetch_sub_explicit(&pool->inside, 1, memory_order_acq_rel) == 1) {
        pthread_cond_signal(&pool->done);
      }
      pthread_mutex_unlock(&pool->lock);
    }
  }
}

static struct orb_pool *pool_start(orb_context *ctx) {
  struct orb_pool *pool = orb_calloc(ctx, 1, sizeof *pool);
  if (!pool) {
    orb_error_clear(ctx); /* the loop then runs in the caller alone */
    return NULL;
  }
  pthread_mutex_init(&pool->lock, NULL);
  pthread_cond_init(&pool->wake, NULL);
  pthread_cond_init(&pool->done, NULL);
  ctx->pool = pool;
  for (int i = 0; i < ctx->options.threads - 1 && i < MAX_WORKERS; i++) {
    pool->worker[i].ctx = ctx;
    pool->worker[i].index = i + 1;
    if (pthread_create(&pool->worker[i].thread, NULL, worker_main, &pool->worker[i]) != 0) {
      break;
    }
    pool->workers++;
  }
  return pool;
}

void orb_pool_stop(orb_context *ctx) {
  struct orb_pool *pool = ctx->pool;
  if (!pool) {
    return;
  }
  pthread_mutex_lock(&pool->lock);
  pool->stopping = 1;
  pthread_cond_broadcast(&pool->wake);
  pthread_mutex_unlock(&pool->lock);
  for (int i = 0; i < pool->workers; i++) {
    pthread_join(pool->worker[i].thread, NULL);
  }
  pthread_mutex_destroy(&pool->lock);
  pthread_cond_destroy(&pool->wake);
  pthread_cond_destroy(&pool->done);
  ctx->pool = NULL;
  orb_free(ctx, pool);
}

static void run_alone(int64_t count, int64_t grain, orb_loop_fn body, void *arg) {
  for (int64_t begin = 0; begin < count; begin += grain) {
    body(arg, begin, begin + grain < count ? begin + grain : count, 0);
  }
}

void orb_parallel_for(orb_context *ctx, int64_t count, int64_t grain, orb_loop_fn body, void *arg) {
  ORB_ASSERT(grain >= 1);
  struct orb_pool *pool = ctx->pool;
  if (count <= grain || ctx->options.threads == 1 || (!pool && !(pool = pool_start(ctx))) || pool->workers == 0) {
    run_alone(count, grain, body, arg);
    return;
  }
  ORB_ASSERT(!ctx->in_loop);
  ctx->in_loop = 1;
  pthread_mutex_lock(&pool->lock);
  pool->body = body;
  pool->arg = arg;
  pool->count = count;
  pool->grain = grain;
  atomic_store(&pool->next, 0);
  pool->open = 1;
  atomic_fetch_add_explicit(&pool->round, 1, memory_order_release);
  pthread_cond_broadcast(&pool->wake);
  pthread_mutex_unlock(&pool->lock);
  take_chunks(pool, 0);
  pthread_mutex_lock(&pool->lock);
  pool->open = 0;
  pthread_mutex_unlock(&pool->lock);
  for (int spin = 0; spin < SPINS && atomic_load_explicit(&pool->inside, memory_order_acquire); spin++) {
    pause_cpu();
  }
  pthread_mutex_lock(&pool->lock);
  while (atomic_load_explicit(&pool->inside, memory_order_acquire)) {
    pthread_cond_wait(&pool->done, &pool->lock);
  }
  pthread_mutex_unlock(&pool->lock);
  ctx->in_loop = 0;
}
