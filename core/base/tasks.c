#include "base/tasks.h"

#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "base/state.h"

typedef struct tasks {
  orb_context *ctx;
  orb_context **failed; /* the parts of tasks that have failed, for their errors */
  orb_status *status;
  orb_task_fn run;
  void *arg;
  int threads; /* of each part */
} tasks;

/* A part lives as long as its task, since it takes 1.5 MB of the budget. */
static void run_range(void *arg, int64_t begin, int64_t end, int thread) {
  tasks *t = arg;
  (void)thread;
  for (int64_t i = begin; i < end; i++) {
    orb_context *part;
    t->status[i] = orb_context_part(t->ctx, t->threads, &part);
    if (t->status[i] != ORB_OK) {
      continue;
    }
    t->status[i] = t->run(part, t->arg, (int32_t)i);
    if (t->status[i] != ORB_OK) {
      t->failed[i] = part;
    } else {
      orb_context_destroy(part);
    }
  }
}

/* Hands the error of the first task that failed to ctx, which has it already if the task got no part. */
static orb_status first_error(const tasks *t, int32_t count) {
  for (int32_t i = 0; i < count; i++) {
    if (t->status[i] != ORB_OK) {
      if (t->failed[i]) {
        *orb_context_error_edit(t->ctx) = *orb_context_error(t->failed[i]);
      }
      return t->status[i];
    }
  }
  return ORB_OK;
}

orb_status orb_tasks_run(orb_context *ctx, int32_t count, orb_task_fn run, void *arg) {
  const int threads = ctx->options.threads;
  if (threads == 1 || count <= 1) {
    for (int32_t i = 0; i < count; i++) {
      ORB_TRY(run(ctx, arg, i));
    }
    return ORB_OK;
  }
  tasks t = {.ctx = ctx, .run = run, .arg = arg, .threads = threads > count ? threads / count : 1};
  t.failed = ORB_NEW0(ctx, orb_context *, count);
  t.status = ORB_NEW0(ctx, orb_status, count);
  orb_status status = t.failed && t.status ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    orb_error_clear(ctx); /* the first failure of the loop is kept */
    orb_parallel_each(ctx, count, run_range, &t);
    status = first_error(&t, count);
  }
  for (int32_t i = 0; t.failed && i < count; i++) {
    orb_context_destroy(t.failed[i]);
  }
  orb_free(ctx, t.failed);
  orb_free(ctx, t.status);
  return status;
}
