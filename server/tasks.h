/* Thread pools for work that handlers must not do themselves: queries, commits, reading and checking files.
 *
 * Contract. Tasks start in the order in which they were added, each on one thread. tasks_stop() runs the waiting tasks,
 * then joins the threads. */
#ifndef ORB_TASKS_H
#define ORB_TASKS_H

typedef struct task {
  struct task *next;
  void (*run)(struct task *self);
} task;

typedef struct tasks tasks;
tasks *tasks_start(int threads);
void tasks_add(tasks *pool, task *t);
void tasks_stop(tasks *pool);

#endif
