/* Each thread begins tasks as long as there are any. Then it helps with the loops of a task that still runs, the one
 * with the fewest helpers, until that ends, and then with another one. */
#include "base/tasks.h"

#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "base/state.h"

typedef struct one_task {
  orb_context *part;   /* while it runs, if it can be helped */
  orb_context *failed; /* the part of a task that has failed, for its error */
  orb_status status;
  int helpers;
} one_task;

typedef struct tasks {
  orb_context *ctx;
  orb_task_fn run;
  void *arg;
  int32_t count;
  one_task *one;
  pthread_mutex_t lock; /* of all that follows, and of the parts and helpers of tasks */
  pthread_cond_t changed;
  int32_t begun, ended;
} tasks;

static int32_t begin_task(tasks *t) {
  pthread_mutex_lock(&t->lock);
  const int32_t i = t->begun < t->count ? t->begun++ : t->count;
  pthread_mutex_unlock(&t->lock);
  return i;
}

/* From now on other threads may help with the loops of this task. */
static void open_task(tasks *t, one_task *one, orb_context *part) {
  orb_pool_open(part);
  pthread_mutex_lock(&t->lock);
  one->part = part->pool ? part : NULL;
  pthread_cond_broadcast(&t->changed);
  pthread_mutex_unlock(&t->lock);
}

/* No thread may begin to help it any more. */
static void end_task(tasks *t, one_task *one) {
  pthread_mutex_lock(&t->lock);
  one->part = NULL;
  t->ended++;
  pthread_cond_broadcast(&t->changed);
  pthread_mutex_unlock(&t->lock);
}

/* A part lives as long as its task, since it takes 1.5 MB of the budget; that of a task that fails, until all have
 * ended. */
static void run_task(tasks *t, int32_t i) {
  one_task *one = &t->one[i];
  orb_context *part = NULL;
  one->status = orb_context_part(t->ctx, &part);
  if (one->status == ORB_OK) {
    open_task(t, one, part);
    one->status = t->run(part, t->arg, i);
  }
  end_task(t, one);
  if (part && one->status != ORB_OK) {
    orb_pool_stop(part);
    one->failed = part;
  } else {
    orb_context_destroy(part);
  }
}

/* The running task with the fewest helpers that this thread can help, or count; *index: as of orb_pool_enter(). */
static int32_t enter_one(tasks *t, int *index) {
  int32_t least = t->count;
  for (int32_t i = 0; i < t->count; i++) {
    if (t->one[i].part && (least == t->count || t->one[i].helpers < t->one[least].helpers)) {
      least = i;
    }
  }
  *index = least < t->count ? orb_pool_enter(t->one[least].part) : 0;
  return *index > 0 ? least : t->count;
}

/* Helps tasks until all have ended. */
static void help(tasks *t) {
  pthread_mutex_lock(&t->lock);
  while (t->ended < t->count) {
    int index;
    const int32_t i = enter_one(t, &index);
    if (i < t->count) {
      orb_context *part = t->one[i].part;
      t->one[i].helpers++;
      pthread_mutex_unlock(&t->lock);
      orb_pool_help(part, index);
      pthread_mutex_lock(&t->lock);
    } else {
      pthread_cond_wait(&t->changed, &t->lock);
    }
  }
  pthread_mutex_unlock(&t->lock);
}

/* What each thread does. */
static void take_part(void *arg, int64_t begin, int64_t end, int thread) {
  tasks *t = arg;
  int32_t i;
  (void)begin;
  (void)end;
  (void)thread;
  while ((i = begin_task(t)) < t->count) {
    run_task(t, i);
  }
  help(t);
}

/* Hands the error of the first task that failed to ctx, which has it already if the task got no part. */
static orb_status first_error(const tasks *t) {
  for (int32_t i = 0; i < t->count; i++) {
    const one_task *one = &t->one[i];
    if (one->status != ORB_OK) {
      if (one->failed) {
        *orb_context_error_edit(t->ctx) = *orb_context_error(one->failed);
      }
      return one->status;
    }
  }
  return ORB_OK;
}

orb_status orb_tasks_run(orb_context *ctx, int32_t count, orb_task_fn run, void *arg) {
  if (orb_pool_threads(ctx) == 1 || count <= 1) {
    for (int32_t i = 0; i < count; i++) {
      ORB_TRY(run(ctx, arg, i));
    }
    return ORB_OK;
  }
  tasks t = {.ctx = ctx, .run = run, .arg = arg, .count = count, .one = ORB_NEW0(ctx, one_task, count)};
  if (!t.one) {
    return ORB_E_NO_MEMORY;
  }
  pthread_mutex_init(&t.lock, NULL);
  pthread_cond_init(&t.changed, NULL);
  orb_error_clear(ctx); /* the first failure of the loop is kept */
  orb_parallel_each(ctx, orb_threads(ctx), take_part, &t);
  const orb_status status = first_error(&t);
  for (int32_t i = 0; i < count; i++) {
    orb_context_destroy(t.one[i].failed);
  }
  pthread_mutex_destroy(&t.lock);
  pthread_cond_destroy(&t.changed);
  orb_free(ctx, t.one);
  return status;
}
