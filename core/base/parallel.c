/* Parallel loops on the context's own threads.
 *
 * One loop runs at a time; the caller takes part as thread 0. Each thread has a range of the chunks, so the next loop
 * over the same data finds most of it in the thread's own cache: the sweeps of a map took two to four times their
 * processor time on two threads when chunks went to whoever came first. A thread that is done with its range helps with
 * the others.
 *
 * An atomic word for each range, the ticket, holds the number of the loop and the next chunk. A thread claims a chunk
 * by raising the ticket, so it cannot take part in a loop that has no chunk left, and the caller waits for claimed
 * chunks only: a thread that has not begun one delays nobody, however late a busy machine runs it. No lock is taken on
 * the way, except to sleep and to wake a sleeper.
 *
 * The pool shares a loop only if that is likely to pay, except for tasks (orb_parallel_each()). It remembers how long
 * an iteration of each body took. A loop that should end sooner than it takes to wake a thread runs in the caller,
 * which watches the clock and shares the rest of a loop that turns out to be long.
 *
 * Threads spin for a short while before they sleep. If a thread spins in vain, it spins half as long the next time; so
 * on a busy machine, where spinning only uses up the job's share, threads soon stop spinning. If some threads cannot be
 * started, the loop runs on the others: results do not depend on how many there are.
 *
 * Rejected: running loops of up to a millisecond on one thread where they were quicker so the last time. Times of
 * single loops vary more than that, and six pairs took 2 % longer.
 *
 * The pool of a task (tasks.h) has no threads of its own. Threads that have nothing else to do enter it, even while a
 * loop runs, and stay until it stops.
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
  SPINS_LEAST = 8,  /* pauses before a thread sleeps */
  SPINS_MOST = 1024,
  COSTS = 128,     /* bodies whose cost is kept; a power of two */
  CACHE_LINE = 64, /* bytes; keeps words apart that different threads write */
  CLOSED = -1      /* as a chunk: no chunk can be claimed */
};

/* Seconds that a loop must take to be handed out to threads that spin, and to threads that have to be woken. A shorter
 * loop mostly waits for data from the other core's cache: with 20 and 50 µs, alignments of three pairs took 10 to 20 %
 * more processor time on two threads, and as long. */
static const double WORTH_SHARING = 80e-6, WORTH_WAKING = 150e-6;

/* What an iteration of a body took, in seconds; 0: not known. */
typedef struct loop_cost {
  orb_loop_fn body;
  double seconds;
} loop_cost;

typedef struct parallel_loop {
  orb_loop_fn body;
  void *arg;
  int64_t start, count, grain;
  uint32_t chunks;
} parallel_loop;

struct orb_pool {
  pthread_mutex_t lock;
  pthread_cond_t wake, done;
  int own; /* workers that the pool has started */
  int stopping;
  int guests;          /* workers that have entered and not left; under the lock */
  atomic_int workers;  /* own ones and guests that have entered: each has a number, from 1 on */
  int spins;           /* of the caller, before it sleeps */
  atomic_int sleepers; /* workers that wait to be woken; written under the lock */
  loop_cost cost[COSTS];
  char apart_from_range[CACHE_LINE];
  struct range {
    atomic_ullong ticket; /* number of the loop << 32 | next chunk, or CLOSED */
    atomic_uint end;      /* of the chunks of the range */
    char apart[CACHE_LINE - sizeof(atomic_ullong) - sizeof(atomic_uint)];
  } range[MAX_WORKERS + 1]; /* one for each thread */
  /* The loop. Written while the tickets are closed; what is read before a ticket is raised belongs to that ticket. */
  _Atomic(orb_loop_fn) body;
  _Atomic(void *) arg;
  atomic_llong start, count, grain;
  atomic_uint chunks;
  atomic_int ranges; /* as many as threads; 0 until a loop is handed out */
  char apart_from_finished[CACHE_LINE];
  atomic_uint finished; /* chunks of this loop that workers have run */
  atomic_uint wanted;   /* the caller sleeps until this many are finished; UINT32_MAX: it does not sleep */
  struct worker {
    orb_context *ctx;
    pthread_t thread;
    int index;
  } worker[MAX_WORKERS];
};

static uint32_t chunk_of(unsigned long long ticket) {
  return (uint32_t)ticket;
}
static uint32_t loop_of(unsigned long long ticket) {
  return (uint32_t)(ticket >> 32);
}

static void run_chunk(const parallel_loop *loop, uint32_t chunk, int thread) {
  int64_t begin = chunk * loop->grain, end = begin + loop->grain < loop->count ? begin + loop->grain : loop->count;
  loop->body(loop->arg, loop->start + begin, loop->start + end, thread);
}

/* Claims chunk *chunk of *loop from a range; 0 where none is left. */
static int claim_of(struct orb_pool *pool, struct range *range, parallel_loop *loop, uint32_t *chunk) {
  unsigned long long ticket = atomic_load_explicit(&range->ticket, memory_order_acquire);
  for (;;) {
    *chunk = chunk_of(ticket);
    if (*chunk >= atomic_load_explicit(&range->end, memory_order_acquire)) {
      return 0;
    }
    loop->chunks = atomic_load_explicit(&pool->chunks, memory_order_acquire);
    loop->body = atomic_load_explicit(&pool->body, memory_order_acquire);
    loop->arg = atomic_load_explicit(&pool->arg, memory_order_acquire);
    loop->start = atomic_load_explicit(&pool->start, memory_order_acquire);
    loop->count = atomic_load_explicit(&pool->count, memory_order_acquire);
    loop->grain = atomic_load_explicit(&pool->grain, memory_order_acquire);
    if (atomic_compare_exchange_weak_explicit(&range->ticket, &ticket, ticket + 1, memory_order_acq_rel,
                                              memory_order_acquire)) {
      return 1;
    }
  }
}

/* Claims a chunk of the thread's own range, or of the next one that has any; 0 where none is left. */
static int claim(struct orb_pool *pool, int thread, parallel_loop *loop, uint32_t *chunk) {
  const int ranges = atomic_load_explicit(&pool->ranges, memory_order_acquire);
  int at = thread < ranges ? thread : 0; /* a guest that has entered during the loop has no range */
  for (int i = 0; i < ranges; i++, at = at + 1 < ranges ? at + 1 : 0) {
    if (claim_of(pool, &pool->range[at], loop, chunk)) {
      return 1;
    }
  }
  return 0;
}

/* The number of the loop that was handed out last. Its ranges are open before the number shows. */
static uint32_t newest_loop(struct orb_pool *pool) {
  return loop_of(atomic_load_explicit(&pool->range[0].ticket, memory_order_acquire));
}

static void pause_cpu(void) {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  __asm__ volatile("yield");
#endif
}

/* The spins of the next wait, after one that ended in time or did not. */
static int adapted(int spins, int in_time) {
  spins = in_time ? 2 * spins : spins / 2;
  return spins < SPINS_LEAST ? SPINS_LEAST : spins > SPINS_MOST ? SPINS_MOST : spins;
}

static void finish_chunk(struct orb_pool *pool) {
  if (atomic_fetch_add(&pool->finished, 1) + 1 == atomic_load(&pool->wanted)) {
    pthread_mutex_lock(&pool->lock);
    pthread_cond_signal(&pool->done);
    pthread_mutex_unlock(&pool->lock);
  }
}

/* Waits for a loop of another number; 0 where the pool stops instead. */
static int next_loop(struct orb_pool *pool, uint32_t number, int *spins) {
  for (int i = 0; i < *spins; i++) {
    if (newest_loop(pool) != number) {
      *spins = adapted(*spins, 1);
      return 1;
    }
    pause_cpu();
  }
  *spins = adapted(*spins, 0);
  pthread_mutex_lock(&pool->lock);
  atomic_fetch_add(&pool->sleepers, 1);
  while (!pool->stopping && loop_of(atomic_load(&pool->range[0].ticket)) == number) {
    pthread_cond_wait(&pool->wake, &pool->lock);
  }
  atomic_fetch_sub(&pool->sleepers, 1);
  int stop = pool->stopping;
  pthread_mutex_unlock(&pool->lock);
  return !stop;
}

/* Takes part in the loops of a pool, as thread number `index`, until it stops. */
static void work_for(struct orb_pool *pool, int index) {
  int spins = SPINS_MOST;
  uint32_t chunk, number;
  do {
    parallel_loop loop;
    number = newest_loop(pool);
    while (claim(pool, index, &loop, &chunk)) {
      run_chunk(&loop, chunk, index);
      finish_chunk(pool);
    }
  } while (next_loop(pool, number, &spins));
}

static void *worker_main(void *argument) {
  struct worker *self = argument;
  work_for(self->ctx->pool, self->index);
  return NULL;
}

static struct orb_pool *pool_create(orb_context *ctx) {
  struct orb_pool *pool = orb_calloc(ctx, 1, sizeof *pool);
  if (!pool) {
    orb_error_clear(ctx); /* the loop then runs in the caller alone */
    return NULL;
  }
  pthread_mutex_init(&pool->lock, NULL);
  pthread_cond_init(&pool->wake, NULL);
  pthread_cond_init(&pool->done, NULL);
  pool->spins = SPINS_MOST;
  for (int i = 0; i <= MAX_WORKERS; i++) {
    atomic_store(&pool->range[i].ticket, (uint32_t)CLOSED);
  }
  atomic_store(&pool->wanted, UINT32_MAX);
  ctx->pool = pool;
  return pool;
}

/* Creates a pool with threads of its own. */
static struct orb_pool *pool_start(orb_context *ctx) {
  struct orb_pool *pool = pool_create(ctx);
  if (!pool) {
    return NULL;
  }
  for (int i = 0; i < ctx->options.threads - 1 && i < MAX_WORKERS; i++) {
    pool->worker[i].ctx = ctx;
    pool->worker[i].index = i + 1;
    if (pthread_create(&pool->worker[i].thread, NULL, worker_main, &pool->worker[i]) != 0) {
      break;
    }
    pool->own++;
  }
  atomic_store(&pool->workers, pool->own);
  return pool;
}

void orb_pool_open(orb_context *ctx) {
  if (!ctx->pool) {
    (void)pool_create(ctx);
  }
}

int orb_pool_enter(orb_context *ctx) {
  struct orb_pool *pool = ctx->pool;
  if (!pool) {
    return 0;
  }
  pthread_mutex_lock(&pool->lock);
  int index = atomic_load(&pool->workers) + 1;
  index = index < ctx->root->options.threads && index <= MAX_WORKERS ? index : 0;
  if (index > 0) {
    pool->guests++;
    atomic_store(&pool->workers, index);
  }
  pthread_mutex_unlock(&pool->lock);
  return index;
}

void orb_pool_help(orb_context *ctx, int index) {
  struct orb_pool *pool = ctx->pool;
  work_for(pool, index);
  pthread_mutex_lock(&pool->lock);
  pool->guests--;
  pthread_cond_signal(&pool->done);
  pthread_mutex_unlock(&pool->lock);
}

int orb_pool_threads(const orb_context *ctx) {
  return ctx->pool ? atomic_load(&ctx->pool->workers) + 1 : ctx->options.threads;
}

void orb_pool_stop(orb_context *ctx) {
  struct orb_pool *pool = ctx->pool;
  if (!pool) {
    return;
  }
  pthread_mutex_lock(&pool->lock);
  pool->stopping = 1;
  pthread_cond_broadcast(&pool->wake);
  while (pool->guests > 0) {
    pthread_cond_wait(&pool->done, &pool->lock);
  }
  pthread_mutex_unlock(&pool->lock);
  for (int i = 0; i < pool->own; i++) {
    pthread_join(pool->worker[i].thread, NULL);
  }
  pthread_mutex_destroy(&pool->lock);
  pthread_cond_destroy(&pool->wake);
  pthread_cond_destroy(&pool->done);
  ctx->pool = NULL;
  orb_free(ctx, pool);
}

/* The entry of this body. If all are in use, it replaces another one. */
static loop_cost *cost_of(struct orb_pool *pool, orb_loop_fn body) {
  size_t at = ((uintptr_t)body >> 4) * 0x9e3779b1U;
  loop_cost *cost = NULL;
  for (int i = 0; i < 8; i++) {
    cost = &pool->cost[(at + (size_t)i) & (COSTS - 1)];
    if (cost->body == body || !cost->body) {
      break;
    }
  }
  if (cost->body != body) {
    *cost = (loop_cost){.body = body};
  }
  return cost;
}

/* A measurement during which the thread was preempted is far too long: it counts no more than twice the last. */
static void learn(loop_cost *cost, double seconds) {
  cost->seconds = cost->seconds > 0 && seconds > 2 * cost->seconds ? 2 * cost->seconds : seconds;
}

static int is_worth_sharing(struct orb_pool *pool, double seconds) {
  int awake = atomic_load_explicit(&pool->sleepers, memory_order_relaxed) <
              atomic_load_explicit(&pool->workers, memory_order_relaxed);
  return seconds > (awake ? WORTH_SHARING : WORTH_WAKING);
}

/* Runs chunks in the caller as long as what is left is not worth sharing. Returns how many. The clock is read after 1,
 * 2, 4, 8 ... chunks. */
static uint32_t begin_alone(struct orb_pool *pool, const parallel_loop *loop, loop_cost *cost) {
  double start = orb_clock();
  for (uint32_t i = 0; i < loop->chunks; i++) {
    run_chunk(loop, i, 0);
    uint32_t done = i + 1;
    if ((done & i) == 0 && done < loop->chunks) {
      double elapsed = orb_clock() - start;
      if (elapsed > WORTH_SHARING && is_worth_sharing(pool, elapsed / done * (loop->chunks - done))) {
        learn(cost, elapsed / (double)(done * loop->grain));
        return done;
      }
    }
  }
  learn(cost, (orb_clock() - start) / (double)loop->count);
  return loop->chunks;
}

/* Publishes chunk `first` and those after it, and wakes as many threads as can have one. */
static void hand_out(struct orb_pool *pool, const parallel_loop *loop, uint32_t first) {
  atomic_store_explicit(&pool->body, loop->body, memory_order_release);
  atomic_store_explicit(&pool->arg, loop->arg, memory_order_release);
  atomic_store_explicit(&pool->start, loop->start, memory_order_release);
  atomic_store_explicit(&pool->count, loop->count, memory_order_release);
  atomic_store_explicit(&pool->grain, loop->grain, memory_order_release);
  atomic_store_explicit(&pool->chunks, loop->chunks, memory_order_release);
  atomic_store_explicit(&pool->finished, 0, memory_order_release);
  unsigned long long number = newest_loop(pool) + 1ULL;
  uint32_t threads = (uint32_t)atomic_load(&pool->workers) + 1;
  atomic_store_explicit(&pool->ranges, (int)threads, memory_order_release);
  for (uint32_t i = threads; i-- > 0;) { /* the range that shows the number comes last */
    uint64_t left = loop->chunks;        /* ranges of all chunks: those of `first` and before are the caller's */
    uint32_t begin = (uint32_t)(left * i / threads), end = (uint32_t)(left * (i + 1) / threads);
    atomic_store_explicit(&pool->range[i].end, end, memory_order_release);
    atomic_store(&pool->range[i].ticket, number << 32 | (begin < first ? first : begin));
  }
  if (atomic_load(&pool->sleepers) > 0) {
    pthread_mutex_lock(&pool->lock); /* until a thread that has looked at the old number sleeps */
    uint32_t sleepers = (uint32_t)atomic_load(&pool->sleepers), useful = loop->chunks - first - 1;
    pthread_mutex_unlock(&pool->lock);
    for (uint32_t i = 0; i < sleepers && i < useful; i++) {
      pthread_cond_signal(&pool->wake);
    }
  }
}

/* Waits until workers have finished this many chunks of the loop. */
static void await(struct orb_pool *pool, uint32_t finished) {
  int spin = 0;
  while (spin < pool->spins && atomic_load_explicit(&pool->finished, memory_order_acquire) != finished) {
    pause_cpu();
    spin++;
  }
  if (spin) {
    pool->spins = adapted(pool->spins, spin < pool->spins);
  }
  if (atomic_load_explicit(&pool->finished, memory_order_acquire) != finished) {
    atomic_store(&pool->wanted, finished);
    pthread_mutex_lock(&pool->lock);
    while (atomic_load(&pool->finished) != finished) {
      pthread_cond_wait(&pool->done, &pool->lock);
    }
    pthread_mutex_unlock(&pool->lock);
    atomic_store(&pool->wanted, UINT32_MAX);
  }
}

/* Shares the loop from chunk `first` on, and returns when all are done. */
static void run_shared(struct orb_pool *pool, const parallel_loop *loop, uint32_t first, loop_cost *cost) {
  double start = orb_clock();
  uint32_t own = 0, chunk;
  hand_out(pool, loop, first);
  for (parallel_loop claimed; claim(pool, 0, &claimed, &chunk); own++) {
    run_chunk(&claimed, chunk, 0);
  }
  if (own > 0) {
    learn(cost, (orb_clock() - start) / (double)(own * loop->grain));
  }
  await(pool, loop->chunks - first - own);
  if (own == 0) { /* others were quicker; else the cost of a body whose loops are always this short stays unknown */
    learn(cost, (orb_clock() - start) / (double)(loop->count - first * loop->grain));
  }
  for (int i = 0; i < atomic_load(&pool->ranges); i++) {
    atomic_store(&pool->range[i].ticket, (unsigned long long)newest_loop(pool) << 32 | (uint32_t)CLOSED);
  }
}

/* always: shares the loop whatever it took before. */
static void run_loop(orb_context *ctx, int64_t start, int64_t count, int64_t grain, orb_loop_fn body, void *arg,
                     int always) {
  ORB_ASSERT(grain >= 1 && count / grain < UINT32_MAX - 1);
  struct orb_pool *pool = ctx->pool;
  parallel_loop loop = {.body = body, .arg = arg, .start = start, .count = count, .grain = grain};
  loop.chunks = (uint32_t)((count + grain - 1) / grain);
  if (loop.chunks < 2 || (!pool && ctx->options.threads == 1) || (!pool && !(pool = pool_start(ctx))) ||
      atomic_load_explicit(&pool->workers, memory_order_acquire) == 0) {
    for (uint32_t i = 0; i < loop.chunks; i++) {
      run_chunk(&loop, i, 0);
    }
    return;
  }
  ORB_ASSERT(!ctx->in_loop);
  ctx->in_loop = 1;
  loop_cost *cost = cost_of(pool, body);
  uint32_t done = 0;
  if (!always && cost->seconds > 0 && !is_worth_sharing(pool, cost->seconds * (double)count)) {
    done = begin_alone(pool, &loop, cost);
  }
  if (done < loop.chunks) {
    run_shared(pool, &loop, done, cost);
  }
  ctx->in_loop = 0;
}

void orb_parallel_slice(orb_context *ctx, int64_t start, int64_t count, int64_t grain, orb_loop_fn body, void *arg) {
  run_loop(ctx, start, count, grain, body, arg, 0);
}

void orb_parallel_each(orb_context *ctx, int64_t count, orb_loop_fn body, void *arg) {
  run_loop(ctx, 0, count, 1, body, arg, 1);
}

void orb_parallel_for(orb_context *ctx, int64_t count, int64_t grain, orb_loop_fn body, void *arg) {
  orb_parallel_slice(ctx, 0, count, grain, body, arg);
}
