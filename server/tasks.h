/* A few threads that do what handlers must not: query, commit, read and check files.
 *
 * Contract. Tasks run in the order in which they came, each on one thread. Stopping runs those that wait and joins. */
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
