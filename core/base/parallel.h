/* Parallel loops on the threads of a context. */
#ifndef ORB_BASE_PARALLEL_H
#define ORB_BASE_PARALLEL_H

#include "orbmorph/context.h"

/* The body of a parallel loop: works on [begin, end) as thread number `thread` (0 ≤ thread < orb_threads()). */
typedef void (*orb_loop_fn)(void *arg, int64_t begin, int64_t end, int thread);

/* Runs body over [0, count) in chunks of `grain` (≥ 1), in parallel; returns when all are done. Chunks begin at
 * multiples of grain for any number of threads, so a sum of per-chunk sums taken in order does not depend on it. Which
 * thread takes which chunk is not fixed. Loops do not nest. A loop that is too short to share runs in the caller. */
void orb_parallel_for(orb_context *ctx, int64_t count, int64_t grain, orb_loop_fn body, void *arg);

/* The same over [start, start + count): chunks begin at start and at multiples of grain from there. */
void orb_parallel_slice(orb_context *ctx, int64_t start, int64_t count, int64_t grain, orb_loop_fn body, void *arg);

/* The same over [0, count) in chunks of one, each of which is worth a thread. */
void orb_parallel_each(orb_context *ctx, int64_t count, orb_loop_fn body, void *arg);

/* Threads that take part in loops of the context now: its own ones, and those that help. Before its first loop: as many
 * as it will start. */
int orb_pool_threads(const orb_context *ctx);

/* Opens the pool of a part (context.h), before its first loop, so that other threads may help with its loops. Without
 * memory the part has none. */
void orb_pool_open(orb_context *ctx);

/* Enters the pool of a context as a thread of its loops. The caller makes sure that the pool does not stop before this
 * returns, and then calls orb_pool_help(): the pool waits for it when it stops. Returns the number of the thread, or 0:
 * there are orb_threads() already, or there is no pool. */
int orb_pool_enter(orb_context *ctx);

/* Helps with the loops of the context as the thread of this number, until the pool stops. */
void orb_pool_help(orb_context *ctx, int index);

/* Waits until helpers have left, joins the threads and frees the pool. Does nothing without a pool. */
void orb_pool_stop(orb_context *ctx);

#endif
