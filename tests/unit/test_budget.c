/* The memory of all processes together: what the parts may hold, and that one that waits for memory gets it. */
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <time.h>

#include <cmocka.h>

#include "budget.h"
#include "tasks.h"

static const int64_t MB = 1 << 20;
/* What is left of 300 MB for the daemon and what its processes take besides their work. */
static const int64_t OF_DAEMON = 100 << 20;
static const int64_t sizes[] = {1 << 20, 4 << 20, 64 << 20, 128 << 20, 400 << 20, 1LL << 30, 4LL << 30, 64LL << 30};
enum { SIZES = sizeof sizes / sizeof *sizes };

static uint64_t next_random(uint64_t *seed) {
  *seed ^= *seed << 13;
  *seed ^= *seed >> 7;
  *seed ^= *seed << 17;
  return *seed;
}

static int64_t least(int64_t a, int64_t b) {
  return a < b ? a : b;
}

static void nap(int64_t ms) {
  nanosleep(&(struct timespec){.tv_sec = ms / 1000, .tv_nsec = ms % 1000 * 1000000}, NULL);
}

/* Takes and gives back at random: never more than job-memory and 300 MB, nor than three parts of their own. A small
 * file and a small job fit at any time. */
static void test_all_together(void **state) {
  (void)state;
  for (int i = 0; i < SIZES; i++) {
    enum { HELD = 400, STEPS = 40000 };
    memory_budget *b = budget_create(sizes[i]);
    struct {
      budget_part part;
      int64_t bytes;
    } held[HELD] = {0};
    uint64_t seed = 88172645463325252u;
    int64_t taken[BUDGET_PARTS] = {0}, most = 0;
    assert_non_null(b);
    for (int step = 0; step < STEPS; step++) {
      const int at = (int)(next_random(&seed) % HELD);
      if (held[at].bytes > 0) {
        budget_give(b, held[at].part, held[at].bytes, NULL);
        taken[held[at].part] -= held[at].bytes;
        held[at].bytes = 0;
        continue;
      }
      held[at].part = (budget_part)(next_random(&seed) % BUDGET_PARTS);
      const int64_t limit = budget_most(b, held[at].part) >> next_random(&seed) % 8;
      const int64_t bytes = 1 + (int64_t)(next_random(&seed) % (uint64_t)limit);
      held[at].bytes = budget_take(b, held[at].part, bytes, NULL) == BUDGET_FREE ? bytes : 0;
      taken[held[at].part] += held[at].bytes;
      const int64_t sum = taken[BUDGET_JOBS] + taken[BUDGET_CHECKS] + taken[BUDGET_SMALL];
      const int64_t kept = least(120 * MB, budget_most(b, BUDGET_SMALL)) - taken[BUDGET_SMALL];
      most = sum > most ? sum : most;
      assert_true(kept <= 0 || budget_look(b, BUDGET_SMALL, kept, NULL) == BUDGET_FREE);
    }
    assert_true(most <= sizes[i] + 300 * MB - OF_DAEMON);
    assert_true(most <= sizes[i] + sizes[i] / 2 + sizes[i] / 4);
    assert_true(most > sizes[i]); /* so the limit was reached */
    budget_destroy(b);
  }
}

/* A single job may have job-memory, a single file half of it, at once what is beside the jobs. */
static void test_promises(void **state) {
  (void)state;
  for (int i = 0; i < SIZES; i++) {
    const int64_t j = sizes[i], beside = least(80 * MB, j / 2);
    memory_budget *b = budget_create(j);
    assert_non_null(b);
    assert_int_equal(budget_take(b, BUDGET_CHECKS, j / 2, NULL), BUDGET_FREE);
    budget_give(b, BUDGET_CHECKS, j / 2, NULL);
    assert_int_equal(budget_take(b, BUDGET_JOBS, j, NULL), BUDGET_FREE);
    assert_int_equal(budget_take(b, BUDGET_CHECKS, beside, NULL), BUDGET_FREE);
    assert_int_equal(budget_look(b, BUDGET_JOBS, 1, NULL), BUDGET_FULL);
    budget_destroy(b);
  }
}

typedef struct waiter {
  memory_budget *b;
  budget_part part;
  int64_t bytes;
  atomic_int goes_on, done; /* done: 1 with the memory, 2 without */
} waiter;

static int continues(void *user) {
  return ((waiter *)user)->goes_on;
}

static void *wait_main(void *user) {
  waiter *w = user;
  w->done = budget_wait(w->b, w->part, w->bytes, continues, w) ? 1 : 2;
  return NULL;
}

static pthread_t start_waiter(waiter *w) {
  pthread_t thread;
  const unsigned before = budget_shortages(w->b, w->part);
  w->goes_on = 1;
  w->done = 0;
  assert_int_equal(pthread_create(&thread, NULL, wait_main, w), 0);
  while (budget_shortages(w->b, w->part) == before) {
    nap(1);
  }
  nap(5); /* it claims under the same lock */
  return thread;
}

/* A check that waits for jobs: later jobs leave it room, however many come, so it gets its memory when those that ran
 * have ended. */
static void test_jobs_leave_room(void **state) {
  (void)state;
  const int64_t j = 4096 * MB;
  memory_budget *b = budget_create(j);
  assert_non_null(b);
  assert_int_equal(budget_take(b, BUDGET_JOBS, j / 2, NULL), BUDGET_FREE);
  assert_int_equal(budget_take(b, BUDGET_JOBS, j / 2, NULL), BUDGET_FREE);
  waiter w = {.b = b, .part = BUDGET_CHECKS, .bytes = j / 2};
  pthread_t thread = start_waiter(&w);
  budget_give(b, BUDGET_JOBS, j / 2, NULL);
  while (w.done == 0) { /* a job that asks first does not get it */
    assert_int_equal(budget_look(b, BUDGET_JOBS, j / 2, NULL), BUDGET_OTHERS);
    nap(1);
  }
  assert_int_equal(pthread_join(thread, NULL), 0);
  assert_int_equal(w.done, 1);
  assert_int_equal(budget_look(b, BUDGET_JOBS, j / 2, NULL), BUDGET_OTHERS);
  budget_give(b, BUDGET_CHECKS, j / 2, NULL);
  assert_int_equal(budget_look(b, BUDGET_JOBS, j / 2, NULL), BUDGET_FREE);
  budget_destroy(b);
}

/* One that is no longer wanted stops waiting, and leaves no claim. */
static void test_no_longer_wanted(void **state) {
  (void)state;
  const int64_t j = 4096 * MB;
  memory_budget *b = budget_create(j);
  assert_non_null(b);
  assert_int_equal(budget_take(b, BUDGET_JOBS, 3 * j / 4, NULL), BUDGET_FREE);
  waiter w = {.b = b, .part = BUDGET_CHECKS, .bytes = j / 2};
  pthread_t thread = start_waiter(&w);
  assert_int_equal(budget_look(b, BUDGET_JOBS, j / 8, NULL), BUDGET_OTHERS);
  w.goes_on = 0;
  assert_int_equal(pthread_join(thread, NULL), 0);
  assert_int_equal(w.done, 2);
  assert_int_equal(budget_look(b, BUDGET_JOBS, j / 8, NULL), BUDGET_FREE);
  budget_destroy(b);
}

/* The older of two claims goes first. Neither hinders those who can never take it: one of the same part is in its way.
 */
static void test_claims(void **state) {
  (void)state;
  const int64_t j = 4096 * MB;
  memory_budget *b = budget_create(j);
  budget_claim job = {.part = BUDGET_JOBS}, check = {.part = BUDGET_CHECKS};
  assert_non_null(b);
  assert_int_equal(budget_take(b, BUDGET_CHECKS, j / 4, NULL), BUDGET_FREE);
  assert_int_equal(budget_take(b, BUDGET_JOBS, j / 2, NULL), BUDGET_FREE);
  budget_claim_bytes(b, &job, j);
  assert_int_equal(budget_look(b, BUDGET_CHECKS, j / 4, NULL), BUDGET_FREE); /* other jobs are in its way */
  budget_give(b, BUDGET_JOBS, j / 2, NULL);
  assert_int_equal(budget_look(b, BUDGET_CHECKS, j / 4, NULL), BUDGET_OTHERS);
  assert_int_equal(budget_look(b, BUDGET_SMALL, 120 * MB, NULL), BUDGET_FREE);
  budget_claim_bytes(b, &check, j / 4);
  assert_int_equal(budget_look(b, BUDGET_CHECKS, j / 4, &check), BUDGET_OTHERS); /* it is newer */
  assert_int_equal(budget_look(b, BUDGET_JOBS, j, &job), BUDGET_OTHERS);         /* the check still has its memory */
  budget_give(b, BUDGET_CHECKS, j / 4, NULL);
  assert_int_equal(budget_take(b, BUDGET_JOBS, j, &job), BUDGET_FREE);
  budget_claim_bytes(b, &job, 0);
  budget_give(b, BUDGET_JOBS, j, NULL);
  assert_int_equal(budget_take(b, BUDGET_CHECKS, j / 4, &check), BUDGET_FREE);
  budget_claim_bytes(b, &check, 0);
  budget_destroy(b);
}

typedef struct waiting_task {
  task t;
  atomic_int is_wanted, ran; /* ran: 1 with memory, 2 without */
} waiting_task;

static int task_is_wanted(task *t) {
  return ((waiting_task *)(void *)t)->is_wanted;
}

static void run_task(task *t) {
  ((waiting_task *)(void *)t)->ran = t->memory > 0 ? 1 : 2;
}

static void wait_for(const waiting_task *w) {
  while (w->ran == 0) {
    nap(1);
  }
}

/* A pool's task that waits for jobs gets the memory before later jobs; one that is no longer wanted ends without. */
static void test_tasks(void **state) {
  (void)state;
  const int64_t j = 4096 * MB;
  memory_budget *b = budget_create(j);
  tasks *pool = tasks_start(1, b);
  assert_non_null(pool);
  assert_int_equal(budget_take(b, BUDGET_JOBS, j / 2, NULL), BUDGET_FREE);
  assert_int_equal(budget_take(b, BUDGET_JOBS, j / 2, NULL), BUDGET_FREE);
  waiting_task first = {.t = {.run = run_task, .is_wanted = task_is_wanted, .memory = j / 2, .part = BUDGET_CHECKS},
                        .is_wanted = 1};
  waiting_task second = first, small = first;
  small.t.memory = 16 * MB;
  tasks_add(pool, &first.t);
  tasks_add(pool, &second.t);
  tasks_add(pool, &small.t); /* fits beside the jobs, and passes */
  wait_for(&small);
  assert_int_equal(small.ran, 1);
  assert_int_equal(first.ran, 0);
  second.is_wanted = 0;
  wait_for(&second);
  assert_int_equal(second.ran, 2);
  assert_int_equal(first.ran, 0);
  budget_give(b, BUDGET_JOBS, j / 2, NULL);
  wait_for(&first);
  assert_int_equal(first.ran, 1);
  tasks_stop(pool);
  assert_int_equal(budget_look(b, BUDGET_JOBS, j / 2, NULL), BUDGET_FREE);
  tasks_free(pool);
  budget_destroy(b);
}

static void count_call(void *user) {
  ++*(atomic_int *)user;
}

/* Where a task that claims memory is no longer wanted, others are told. */
static void test_claim_of_a_task_ends(void **state) {
  (void)state;
  const int64_t j = 4096 * MB;
  atomic_int calls = 0;
  memory_budget *b = budget_create(j);
  budget_listen(b, count_call, &calls);
  tasks *pool = tasks_start(1, b);
  assert_non_null(pool);
  assert_int_equal(budget_take(b, BUDGET_JOBS, 3 * j / 4, NULL), BUDGET_FREE);
  waiting_task w = {.t = {.run = run_task, .is_wanted = task_is_wanted, .memory = j / 2, .part = BUDGET_CHECKS},
                    .is_wanted = 1};
  tasks_add(pool, &w.t);
  while (budget_look(b, BUDGET_JOBS, j / 8, NULL) != BUDGET_OTHERS) {
    nap(1);
  }
  const int before = calls;
  w.is_wanted = 0;
  wait_for(&w);
  while (calls == before) {
    nap(1);
  }
  assert_int_equal(budget_look(b, BUDGET_JOBS, j / 8, NULL), BUDGET_FREE);
  tasks_stop(pool);
  tasks_free(pool);
  budget_destroy(b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_all_together),
      cmocka_unit_test(test_promises),
      cmocka_unit_test(test_jobs_leave_room),
      cmocka_unit_test(test_no_longer_wanted),
      cmocka_unit_test(test_claims),
      cmocka_unit_test(test_tasks),
      cmocka_unit_test(test_claim_of_a_task_ends),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
