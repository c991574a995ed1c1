#include "base/tasks.h"

#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "base/state.h"

typedef struct tasks {
  orb_context **part; /* one for each task */
  orb_status *status;
  orb_task_fn run;
  void *arg;
} tasks;

static void run_range(void *arg, int64_t begin, int64_t end, int thread) {
  const tasks *t = arg;
  (void)thread;
  for (int64_t i = begin; i < end; i++) {
    t->status[i] = t->run(t->part[i], t->arg, (int32_t)i);
  }
}

/* Hands the error of the first task that failed to ctx. */
static orb_status first_error(orb_context *ctx, const tasks *t, int32_t count) {
  for (int32_t i = 0; i < count; i++) {
    if (t->status[i] != ORB_OK) {
      *orb_context_error_edit(ctx) = *orb_context_error(t->part[i]);
      return t->status[i];
    }
  }
  return ORB_OK;
}

orb_status orb_tasks_run(orb_context *ctx, int32_t count, orb_task_fn run, void *arg) {
  const int threads = ctx->options.threads;
  if (threads == 1 || count == 1) {
    for (int32_t i = 0; i < count; i++) {
      ORB_TRY(run(ctx, arg, i));
    }
    return ORB_OK;
  }
  tasks t = {.run = run, .arg = arg};
  t.part = ORB_NEW0(ctx, orb_context *, count);
  t.status = ORB_NEW0(ctx, orb_status, count);
  orb_status status = t.part && t.status ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t i = 0; i < count && status == ORB_OK; i++) {
    status = orb_context_part(ctx, threads > count ? threads / count : 1, &t.part[i]);
  }
  if (status == ORB_OK) {
    orb_parallel_each(ctx, count, run_range, &t);
    status = first_error(ctx, &t, count);
  }
  for (int32_t i = 0; t.part && i < count; i++) {
    orb_context_destroy(t.part[i]);
  }
  orb_free(ctx, t.part);
  orb_free(ctx, t.status);
  return status;
}
