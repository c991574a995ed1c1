/* Tasks that run side by side: each once, on a part of the context that shares its budget, cancel flag and progress,
 * and has an error of its own. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "base/tasks.h"
#include "orbmorph/context.h"

/* LEFT: bytes that a task leaves behind, more than all parts of a context take together. */
enum { TASKS = 5, INNER = 3, MOST = 1000, LEFT = 10000000 };

static const int threads_tried[] = {1, 2, 3, 8};

static orb_context *context_of(int threads, size_t memory) {
  const orb_context_options options = {.threads = threads, .memory_limit = memory};
  orb_context *made;
  assert_int_equal(orb_context_create(&options, &made), ORB_OK);
  return made;
}

typedef struct work {
  int64_t square[MOST];
  int64_t sum[INNER];
  atomic_int times;
} work;

static void fill_squares(void *arg, int64_t begin, int64_t end, int thread) {
  work *w = arg;
  (void)thread;
  for (int64_t i = begin; i < end; i++) {
    w->square[i] = i * i;
  }
}

static orb_status add_third(orb_context *ctx, void *arg, int32_t task) {
  work *w = arg;
  for (int64_t i = task; i < MOST; i += INNER) {
    w->sum[task] += w->square[i];
  }
  return orb_context_check(ctx);
}

/* A loop, and tasks within the task. */
static orb_status do_work(orb_context *ctx, void *arg, int32_t task) {
  work *w = (work *)arg + task;
  atomic_fetch_add(&w->times, 1);
  orb_parallel_for(ctx, MOST, 7, fill_squares, w);
  return orb_tasks_run(ctx, INNER, add_third, w);
}

static void each_task_once(void **unused) {
  static work all[TASKS];
  (void)unused;
  for (size_t t = 0; t < sizeof threads_tried / sizeof *threads_tried; t++) {
    orb_context *ctx = context_of(threads_tried[t], 0);
    memset(all, 0, sizeof all);
    assert_int_equal(orb_tasks_run(ctx, TASKS, do_work, all), ORB_OK);
    for (int i = 0; i < TASKS; i++) {
      assert_int_equal(atomic_load(&all[i].times), 1);
      assert_int_equal(all[i].sum[0] + all[i].sum[1] + all[i].sum[2],
                       (int64_t)(MOST - 1) * MOST * (2 * MOST - 1) / 6); /* of the squares below MOST */
    }
    orb_context_destroy(ctx);
  }
}

/* Task 0 recovers from an error, as searches do; tasks 2 and 4 fail. */
static orb_status fail_some(orb_context *ctx, void *arg, int32_t task) {
  (void)arg;
  if (task == 0) {
    orb_status status = orb_fail(ctx, ORB_E_NOT_CERTIFIED, "This one is forgotten.");
    orb_error_clear(ctx);
    return status == ORB_E_NOT_CERTIFIED ? ORB_OK : ORB_E_INTERNAL;
  }
  return task % 2 == 0 ? orb_fail(ctx, ORB_E_BAD_OPTION, "Task %d has failed.", task) : ORB_OK;
}

static void first_failure_is_told(void **unused) {
  (void)unused;
  for (size_t t = 0; t < sizeof threads_tried / sizeof *threads_tried; t++) {
    orb_context *ctx = context_of(threads_tried[t], 0);
    assert_int_equal(orb_tasks_run(ctx, TASKS, fail_some, NULL), ORB_E_BAD_OPTION);
    assert_int_equal(orb_context_error(ctx)->status, ORB_E_BAD_OPTION);
    assert_string_equal(orb_context_error(ctx)->detail, "Task 2 has failed.");
    orb_context_destroy(ctx);
  }
}

static orb_status leave_behind(orb_context *ctx, void *arg, int32_t task) {
  char **left = arg;
  left[task] = ORB_NEW(ctx, char, LEFT);
  return left[task] ? ORB_OK : ORB_E_NO_MEMORY;
}

static void budget_is_shared(void **unused) {
  (void)unused;
  for (size_t t = 0; t < sizeof threads_tried / sizeof *threads_tried; t++) {
    char *left[TASKS] = {NULL};
    orb_context *ctx = context_of(threads_tried[t], 0);
    assert_int_equal(orb_tasks_run(ctx, TASKS, leave_behind, left), ORB_OK);
    assert_in_range(orb_memory_used(ctx), TASKS * LEFT, (TASKS + 1) * LEFT);
    for (int i = 0; i < TASKS; i++) {
      orb_free(ctx, left[i]);
    }
    orb_context_destroy(ctx); /* asserts that all is freed */
    memset(left, 0, sizeof left);
    ctx = context_of(threads_tried[t], (size_t)TASKS * LEFT - 1); /* one task too many, whichever comes last */
    assert_int_equal(orb_tasks_run(ctx, TASKS, leave_behind, left), ORB_E_NO_MEMORY);
    assert_non_null(strstr(orb_context_error(ctx)->detail, "memory budget of 49999999 bytes"));
    int made = 0;
    for (int i = 0; i < TASKS; i++) {
      made += left[i] != NULL;
      orb_free(ctx, left[i]);
    }
    assert_in_range(made, TASKS - 2, TASKS - 1);
    orb_context_destroy(ctx);
  }
}

static orb_status check(orb_context *ctx, void *arg, int32_t task) {
  atomic_int *checks = arg;
  atomic_fetch_add(checks, 1);
  if (task == 0) {
    orb_context_cancel(ctx);
  }
  return orb_context_check(ctx);
}

static void cancelling_reaches_all(void **unused) {
  (void)unused;
  for (size_t t = 0; t < sizeof threads_tried / sizeof *threads_tried; t++) {
    atomic_int checks = 0;
    orb_context *ctx = context_of(threads_tried[t], 0);
    assert_int_equal(orb_tasks_run(ctx, TASKS, check, &checks), ORB_E_CANCELLED);
    assert_int_equal(orb_context_check(ctx), ORB_E_CANCELLED);
    orb_context_destroy(ctx);
  }
}

static void count_report(void *user, const char *stage, double fraction) {
  int *reports = user; /* reports do not overlap */
  *reports += strcmp(stage, "align") == 0 && fraction == 0.5 ? 1 : 100;
}

static orb_status report(orb_context *ctx, void *arg, int32_t task) {
  (void)arg;
  (void)task;
  orb_progress(ctx, "align", 0.5);
  return ORB_OK;
}

static void progress_is_the_callers(void **unused) {
  (void)unused;
  for (size_t t = 0; t < sizeof threads_tried / sizeof *threads_tried; t++) {
    int reports = 0;
    const orb_context_options options = {
        .threads = threads_tried[t], .progress = count_report, .progress_user = &reports};
    orb_context *ctx;
    assert_int_equal(orb_context_create(&options, &ctx), ORB_OK);
    assert_int_equal(orb_tasks_run(ctx, TASKS, report, NULL), ORB_OK);
    assert_in_range(reports, 1, TASKS); /* one that collides with another is dropped */
    orb_context_destroy(ctx);
  }
}

typedef struct helped {
  atomic_int by[9]; /* chunks by thread */
  atomic_int wrong; /* threads that there are not */
  int threads, is_helped;
} helped;

/* Takes a millisecond, so a loop of a few is worth sharing. */
static void work_slowly(void *arg, int64_t begin, int64_t end, int thread) {
  helped *h = arg;
  const struct timespec pause = {.tv_nsec = 1000000};
  (void)begin;
  (void)end;
  if (thread < 0 || thread >= h->threads) {
    atomic_fetch_add(&h->wrong, 1);
  } else {
    atomic_fetch_add(&h->by[thread], 1);
  }
  nanosleep(&pause, NULL);
}

/* Task 1 runs loops until another thread takes part, or for ten seconds. The others end at once. */
static orb_status wait_for_help(orb_context *ctx, void *arg, int32_t task) {
  helped *h = arg;
  for (int i = 0; task == 1 && i < 1000 && !h->is_helped; i++) {
    orb_parallel_for(ctx, 10, 1, work_slowly, h);
    for (int t = 1; t < h->threads; t++) {
      h->is_helped |= atomic_load(&h->by[t]) > 0;
    }
  }
  return ORB_OK;
}

static void idle_threads_help(void **unused) {
  (void)unused;
  for (size_t t = 0; t < sizeof threads_tried / sizeof *threads_tried; t++) {
    helped h = {.threads = threads_tried[t]};
    if (h.threads == 1) {
      continue;
    }
    orb_context *ctx = context_of(h.threads, 0);
    assert_int_equal(orb_tasks_run(ctx, 2, wait_for_help, &h), ORB_OK);
    assert_true(h.is_helped);
    assert_int_equal(atomic_load(&h.wrong), 0);
    orb_context_destroy(ctx);
  }
}

typedef struct nested {
  helped help;
  work inner;
} nested;

/* As wait_for_help(), and then tasks within the task, which the helper takes part in. */
static orb_status work_when_helped(orb_context *ctx, void *arg, int32_t task) {
  nested *n = arg;
  if (task == 0) {
    return ORB_OK;
  }
  const orb_status status = wait_for_help(ctx, &n->help, task);
  return status == ORB_OK ? do_work(ctx, &n->inner, 0) : status;
}

static void helpers_take_inner_tasks(void **unused) {
  (void)unused;
  for (size_t t = 0; t < sizeof threads_tried / sizeof *threads_tried; t++) {
    static nested n;
    memset(&n, 0, sizeof n);
    n.help.threads = threads_tried[t];
    if (n.help.threads == 1) {
      continue;
    }
    orb_context *ctx = context_of(n.help.threads, 0);
    assert_int_equal(orb_tasks_run(ctx, 2, work_when_helped, &n), ORB_OK);
    assert_true(n.help.is_helped);
    assert_int_equal(n.inner.sum[0] + n.inner.sum[1] + n.inner.sum[2],
                     (int64_t)(MOST - 1) * MOST * (2 * MOST - 1) / 6); /* of the squares below MOST */
    orb_context_destroy(ctx);
  }
}

/* Fails the n-th allocation and all after it. */
typedef struct failing {
  atomic_int left, blocks;
} failing;

static void *fail_alloc(void *user, size_t size) {
  failing *f = user;
  void *block = atomic_fetch_sub(&f->left, 1) > 0 ? malloc(size) : NULL;
  atomic_fetch_add(&f->blocks, block != NULL);
  return block;
}

static void fail_free(void *user, void *block) {
  failing *f = user;
  atomic_fetch_sub(&f->blocks, block != NULL);
  free(block);
}

/* Without memory for a part, or for its pool, tasks fail or run without help, and nothing is lost. */
static void no_memory_is_told(void **unused) {
  static work all[TASKS];
  int has_failed = 0, has_worked = 0;
  (void)unused;
  for (int n = 1; n < 200 && !has_worked; n++) {
    failing f = {n, 0};
    const orb_context_options options = {.threads = 3, .allocator = {fail_alloc, fail_free, &f}};
    orb_context *ctx;
    if (orb_context_create(&options, &ctx) != ORB_OK) {
      continue;
    }
    memset(all, 0, sizeof all);
    const orb_status status = orb_tasks_run(ctx, TASKS, do_work, all);
    assert_true(status == ORB_OK || status == ORB_E_NO_MEMORY);
    has_failed += status == ORB_E_NO_MEMORY;
    has_worked = status == ORB_OK && atomic_load(&f.left) > 0;
    for (int i = 0; status == ORB_OK && i < TASKS; i++) {
      assert_int_equal(atomic_load(&all[i].times), 1);
    }
    orb_context_destroy(ctx);
    assert_int_equal(atomic_load(&f.blocks), 0);
  }
  assert_true(has_failed > 0 && has_worked);
}

typedef struct reports {
  int count, wrong;
  double last;
} reports;

static void note_report(void *user, const char *stage, double fraction) {
  reports *r = user;
  r->wrong += strcmp(stage, "align") != 0 || !(fraction > r->last && fraction <= 1); /* other threads cannot assert */
  r->last = fraction;
  r->count++;
}

static orb_status make_steps(orb_context *ctx, void *arg, int32_t i) {
  (void)arg;
  (void)i;
  orb_progress_steps(ctx, 100);
  return ORB_OK;
}

/* Steps of tasks show as a share of what is expected, and of more of them something is always left. */
static void steps_are_reported_as_a_share(void **state) {
  (void)state;
  reports r = {.last = 0};
  orb_context *ctx;
  const orb_context_options options = {.threads = 2, .progress = note_report, .progress_user = &r};
  assert_int_equal(orb_context_create(&options, &ctx), ORB_OK);
  orb_progress_steps(ctx, 1); /* not expected: nothing is reported */
  assert_int_equal(r.count, 0);
  (void)orb_progress_only(ctx, "align");
  orb_progress_expect(ctx, 1000);
  assert_int_equal(orb_tasks_run(ctx, 5, make_steps, NULL), ORB_OK);
  orb_progress_steps(ctx, 100); /* a task that met another one may have reported nothing */
  assert_true(fabs(r.last - 0.6) < 1e-12);
  for (int i = 0; i < 9000; i++) {
    orb_progress_steps(ctx, 1);
    assert_true(i > 50 || fabs(r.last - 0.6 - 1e-3 * (i + 1)) < 1e-3 + 1e-12);
    assert_true(i > 1000 || r.last < 0.999);
  }
  const int count = r.count;
  assert_true(count > 300 && count < 407 && r.last > 0.99); /* each tells a thousandth at least */
  orb_progress_expect(ctx, 0);
  orb_progress_steps(ctx, 1000);
  assert_int_equal(r.count, count);
  assert_int_equal(r.wrong, 0);
  orb_context_destroy(ctx);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(steps_are_reported_as_a_share),
                                     cmocka_unit_test(each_task_once),
                                     cmocka_unit_test(first_failure_is_told),
                                     cmocka_unit_test(budget_is_shared),
                                     cmocka_unit_test(cancelling_reaches_all),
                                     cmocka_unit_test(progress_is_the_callers),
                                     cmocka_unit_test(idle_threads_help),
                                     cmocka_unit_test(helpers_take_inner_tasks),
                                     cmocka_unit_test(no_memory_is_told)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
