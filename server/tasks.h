/* Thread pools for work that handlers must not do themselves: queries, commits, reading and checking files.
 *
 * Contract. Tasks of one owner start in the order in which they were added, each on one thread. Owners take turns: the
 * owner with the fewest running tasks goes first, then the one that has used the least time of threads. An owner that
 * returns after a pause starts level with the least served of the others. While the memory for a
 * task is lacking, others pass it; if it is no longer wanted meanwhile, it runs without memory. tasks_stop() runs the
 * waiting tasks, then joins the threads.
 */
#ifndef ORB_TASKS_H
#define ORB_TASKS_H

#include <stdint.h>

#include "budget.h"

typedef struct task {
  struct task *next;
  void (*run)(struct task *self);
  int (*is_wanted)(struct task *self); /* asked while it waits for memory; NULL: always wanted */
  int64_t memory;                      /* bytes that it needs; 0: little, or it is no longer wanted */
  budget_part part;                    /* from which they are taken */
  uint64_t owner; /* a hash of the client or tenant that asked for it; 0: all others, together one owner */
} task;

typedef struct tasks tasks;
tasks *tasks_start(int threads, memory_budget *memory); /* memory NULL: that of tasks does not count */
void tasks_add(tasks *pool, task *t);
void tasks_stop(tasks *pool);
/* After tasks_stop() of all pools of one budget. */
void tasks_free(tasks *pool);

#endif
