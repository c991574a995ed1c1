/* Whose job runs next: owners are charged for the measured time of workers, not for the size of their meshes. The clock
 * stands while a test has a store, so that slow writes charge nobody. The start of a running job is set back to stand
 * for elapsed time. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "queue/internal.h"
#include "support_store.h"
#include "tasks.h"

enum { SMALL = 1000, SECOND = 1000 };

int64_t __real_orb_clock_ms(void), __wrap_orb_clock_ms(void); /* --wrap */
static int64_t stands_at;                                     /* 0: the clock runs */

int64_t __wrap_orb_clock_ms(void) {
  return stands_at ? stands_at : __real_orb_clock_ms();
}

static int setup(void **state) {
  stands_at = __real_orb_clock_ms();
  return stored_setup(state);
}

static int teardown(void **state) {
  stands_at = 0;
  return stored_teardown(state);
}

static queue *open_queue(const stored *s, int workers) {
  const queue_options options = {.workers = workers, .cores = workers, .limit = 1000};
  queue *q = queue_create(&options, s->cat);
  assert_non_null(q);
  return q;
}

static void submit(stored *s, queue *q, const char *owner, int64_t cost) {
  char key[API_ID_SIZE];
  job *j = NULL;
  snprintf(key, sizeof key, "%064x", (unsigned)++s->number);
  const queue_request request = {
      .kind = API_JOB_EMBEDDING, .key = key, .request = "{}", .owner = owner, .cost = cost, .listed = 1};
  assert_int_equal(queue_submit(q, &request, &j, NULL), QUEUE_OK);
  queue_release(q, j);
}

/* Takes the next job, which must be this owner's. */
static job *take_in(queue *q, queue_lane lane, const char *owner) {
  job *j = NULL;
  int threads;
  assert_int_equal(queue_take(q, lane, &j, &threads), 1);
  assert_string_equal(job_owner(j), owner);
  return j;
}

static job *take(queue *q, const char *owner) {
  return take_in(q, QUEUE_COMPUTES, owner);
}

static void pass(queue *q, job *j, int64_t ms) {
  pthread_mutex_lock(&q->lock);
  j->taken_at -= ms;
  pthread_mutex_unlock(&q->lock);
}

static void end_after(queue *q, job *j, int64_t ms) {
  assert_int_equal(queue_claim(q, j), STORE_OK);
  pass(q, j, ms);
  queue_finish(q, j, API_JOB_CANCELLED, NULL);
}

/* All meshes have the same size, but those of one owner take ten times as long. */
static void test_time_decides(void **state) {
  stored *s = *state;
  queue *q = open_queue(s, 1);
  for (int i = 0; i < 3; i++) {
    submit(s, q, "long", SMALL);
  }
  for (int i = 0; i < 12; i++) {
    submit(s, q, "short", SMALL);
  }
  end_after(q, take(q, "long"), 10 * SECOND + SECOND / 2);
  for (int i = 0; i < 11; i++) {
    end_after(q, take(q, "short"), SECOND);
  }
  end_after(q, take(q, "long"), 10 * SECOND);
  end_after(q, take(q, "short"), SECOND);
  end_after(q, take(q, "long"), SECOND);
  queue_destroy(q);
}

/* A huge mesh that is done at once costs its owner the time that it took, not the estimate. */
static void test_measure_replaces_estimate(void **state) {
  stored *s = *state;
  queue *q = open_queue(s, 1);
  const int64_t huge = 60 * SECOND * TRIANGLES_A_MS;
  submit(s, q, "huge", huge);
  submit(s, q, "small", SMALL);
  submit(s, q, "huge", SMALL);
  submit(s, q, "small", SMALL);
  end_after(q, take(q, "huge"), 0);
  end_after(q, take(q, "small"), 5 * SECOND);
  end_after(q, take(q, "huge"), 0);
  end_after(q, take(q, "small"), 0);
  queue_destroy(q);
}

/* While a job runs, its owner pays at least the estimate, and more as soon as the job has taken longer. */
static void test_running_jobs_count(void **state) {
  stored *s = *state;
  queue *q = open_queue(s, 4);
  submit(s, q, "first", SMALL);
  submit(s, q, "second", SMALL);
  job *first = take(q, "first"), *second = take(q, "second");
  pass(q, first, 2 * SECOND);
  pass(q, second, SECOND);
  submit(s, q, "first", SMALL);
  submit(s, q, "second", SMALL);
  job *third = take(q, "second");
  queue_give_back(q, third);
  pass(q, second, 2 * SECOND);
  queue_give_back(q, take(q, "first"));
  queue_give_back(q, first);
  queue_give_back(q, second);
  queue_destroy(q);
}

/* While another owner waits, an owner has at most its share of the workers, however little it has used before. */
static void test_share(void **state) {
  stored *s = *state;
  queue *q = open_queue(s, 2);
  submit(s, q, "few", SMALL);
  for (int i = 0; i < 3; i++) {
    submit(s, q, "many", SMALL);
  }
  pthread_mutex_lock(&q->lock);
  for (int i = 0; i < q->owner_count; i++) {
    q->owners[i].service = strcmp(q->owners[i].name, "many") == 0 ? 0 : 100 * SECOND;
  }
  pthread_mutex_unlock(&q->lock);
  job *first = take(q, "many"), *second = take(q, "few");
  end_after(q, second, 0);
  job *beside = take(q, "many"); /* nobody else waits: all workers are free for it */
  queue_give_back(q, beside);
  queue_give_back(q, first);
  queue_destroy(q);
}

/* An owner that pauses saves no turns: it comes back level with the least served owner. */
static void test_pauses_earn_nothing(void **state) {
  stored *s = *state;
  queue *q = open_queue(s, 1);
  submit(s, q, "paused", SMALL);
  end_after(q, take(q, "paused"), 0);
  submit(s, q, "busy", SMALL);
  end_after(q, take(q, "busy"), 50 * SECOND);
  for (int i = 0; i < 2; i++) {
    submit(s, q, "busy", SMALL);
  }
  for (int i = 0; i < 2; i++) {
    submit(s, q, "paused", SMALL);
  }
  end_after(q, take(q, "busy"), SECOND); /* level: the older one */
  end_after(q, take(q, "paused"), 2 * SECOND);
  end_after(q, take(q, "busy"), SECOND);
  end_after(q, take(q, "paused"), SECOND);
  queue_destroy(q);
}

/* A job that is given back costs its owner the time that it had a worker. */
static void test_given_back(void **state) {
  stored *s = *state;
  queue *q = open_queue(s, 1);
  submit(s, q, "one", SMALL);
  submit(s, q, "two", SMALL);
  job *j = take(q, "one");
  pass(q, j, 5 * SECOND);
  queue_give_back(q, j);
  end_after(q, take(q, "two"), 6 * SECOND);
  end_after(q, take(q, "one"), 0);
  queue_destroy(q);
}

/* A worker has taken a job, and has no context for it yet when the daemon stops: the job is cancelled even so. */
static void test_a_stop_before_the_context(void **state) {
  queue *q = open_queue(*state, 1);
  orb_context *ctx;
  submit(*state, q, "endless", SMALL);
  job *j = take(q, "endless");
  assert_int_equal(orb_context_create(&(orb_context_options){.threads = 1}, &ctx), ORB_OK);
  queue_stop(q, 1);
  queue_set_context(q, j, ctx);
  assert_int_equal(orb_context_check(ctx), ORB_E_CANCELLED);
  queue_set_context(q, j, NULL);
  queue_give_back(q, j);
  queue_destroy(q);
  orb_context_destroy(ctx);
}

/* A job whose process was killed, perhaps because memory was short, runs alone the next time. Small jobs of other
 * owners neither wait for that nor until it can begin. */
static void test_guests_pass_a_suspect(void **state) {
  stored *s = *state;
  queue *q = open_queue(s, 2);
  assert_int_equal(queue_recover(q, 1), STORE_OK);
  submit(s, q, "killed", SMALL);
  submit(s, q, "long", SMALL);
  job *killed = take(q, "killed"), *other = take(q, "long");
  assert_int_equal(queue_claim(q, killed), STORE_OK);
  assert_int_equal(queue_crashed(q, killed, QUEUE_SUSPECTED), 0);
  submit(s, q, "small", SMALL);
  job *first = take_in(q, QUEUE_GUESTS, "small");
  end_after(q, other, SECOND);
  killed = take(q, "killed");
  assert_ptr_equal(q->alone, killed);
  submit(s, q, "late", SMALL);
  end_after(q, take_in(q, QUEUE_GUESTS, "late"), 0);
  end_after(q, first, 0);
  assert_ptr_equal(q->alone, killed);
  end_after(q, killed, 0);
  assert_null(q->alone);
  queue_destroy(q);
}

/* What a worker finds; it does not wait. */
static job *look(queue *q) {
  pthread_mutex_lock(&q->lock);
  job *j = schedule_choose(q, QUEUE_COMPUTES);
  pthread_mutex_unlock(&q->lock);
  return j;
}

static void let_wait_pass(queue *q, job *j) {
  pthread_mutex_lock(&q->lock);
  j->alone_until -= SUSPECT_MS;
  pthread_mutex_unlock(&q->lock);
}

/* A queue whose jobs have processes of their own, with two workers, of which one has a job; another job is a suspect.
 */
static queue *open_with_suspect(stored *s, job **suspect, job **other) {
  queue *q = open_queue(s, 2);
  assert_int_equal(queue_recover(q, 1), STORE_OK);
  submit(s, q, "killed", SMALL);
  submit(s, q, "long", SMALL);
  *suspect = take(q, "killed");
  *other = take(q, "long");
  assert_int_equal(queue_claim(q, *suspect), STORE_OK);
  assert_int_equal(queue_crashed(q, *suspect, QUEUE_SUSPECTED), 0);
  assert_null(look(q));
  submit(s, q, "late", SMALL);
  return q;
}

/* A suspect waits until the others have ended, and keeps those that come later waiting, but only for so long. Then it
 * runs beside them, so its next death does not count for it alone. */
static void test_a_suspect_waits_only_so_long(void **state) {
  job *killed, *other;
  queue *q = open_with_suspect(*state, &killed, &other);
  assert_null(look(q));
  let_wait_pass(q, killed);
  assert_non_null(look(q));
  pass(q, other, SECOND); /* so that "late" is not the next one */
  assert_ptr_equal(take(q, "killed"), killed);
  assert_null(q->alone);
  assert_int_equal(queue_claim(q, killed), STORE_OK);
  assert_false(queue_runs_alone(q, killed));
  end_after(q, other, 0);
  end_after(q, take(q, "late"), 0);
  queue_give_back(q, killed);
  queue_destroy(q);
}

/* Others wait for a suspect that runs alone, but only for so long. It was alone until another one began. */
static void test_others_wait_only_so_long(void **state) {
  job *killed, *other;
  queue *q = open_with_suspect(*state, &killed, &other);
  end_after(q, other, SECOND);
  assert_ptr_equal(take(q, "killed"), killed);
  assert_int_equal(queue_claim(q, killed), STORE_OK);
  assert_null(look(q));
  let_wait_pass(q, killed);
  assert_true(queue_runs_alone(q, killed));
  job *late = take(q, "late");
  assert_false(queue_runs_alone(q, killed));
  end_after(q, late, 0);
  queue_give_back(q, killed);
  queue_destroy(q);
}

/* A job whose process ended with all others is no suspect. Such an end counts only if the job repeats without end. */
static void test_nobody_is_blamed(void **state) {
  stored *s = *state;
  queue *q = open_queue(s, 2);
  assert_int_equal(queue_recover(q, 1), STORE_OK);
  submit(s, q, "one", SMALL);
  submit(s, q, "two", SMALL);
  job *one = take(q, "one"), *two = take(q, "two");
  for (int attempt = 1; attempt < ATTEMPTS_BORNE; attempt++) {
    assert_int_equal(queue_claim(q, one), STORE_OK);
    assert_int_equal(queue_crashed(q, one, attempt % 2 ? QUEUE_NOT_BLAMED : QUEUE_SUSPECTED), 0);
    assert_int_equal(one->row.suspect, attempt % 2 == 0);
    assert_int_equal(one->row.crashes, 0);
    let_wait_pass(q, one);
    assert_ptr_equal(take(q, "one"), one);
  }
  for (int crash = 1; crash <= CRASHES_MOST; crash++) {
    assert_int_equal(queue_claim(q, one), STORE_OK);
    assert_int_equal(queue_crashed(q, one, QUEUE_NOT_BLAMED), crash == CRASHES_MOST);
    assert_int_equal(one->row.crashes, crash < CRASHES_MOST ? crash : CRASHES_MOST - 1);
    if (crash < CRASHES_MOST) {
      assert_ptr_equal(take(q, "one"), one);
    }
  }
  queue_finish(q, one, API_JOB_FAILED, "{}");
  end_after(q, two, 0);
  queue_destroy(q);
}

enum { MANY = 5, FEW = 2, MANY_MS = 20 };

typedef struct noted {
  task task; /* the first member: its address is that of the struct */
  int ms, *next, at;
} noted;

/* Without isolation a suspect runs alone and is not a guest: as a guest it would keep all others out after its end. */
static void test_a_suspect_is_no_guest(void **state) {
  stored *s = *state;
  queue *q = open_queue(s, 2);
  submit(s, q, "suspect", SMALL);
  submit(s, q, "small", SMALL);
  q->first->row.suspect = 1;
  q->first->alone_until = INT64_MAX;
  pthread_mutex_lock(&q->lock);
  assert_null(schedule_choose(q, QUEUE_GUESTS));
  pthread_mutex_unlock(&q->lock);
  end_after(q, take(q, "suspect"), 0);
  end_after(q, take(q, "small"), 0);
  queue_destroy(q);
}

static void sleep_ms(int ms) {
  nanosleep(&(struct timespec){.tv_nsec = ms * 1000000L}, NULL);
}

static void note(task *t) {
  noted *n = (noted *)(void *)t;
  n->at = __atomic_fetch_add(n->next, 1, __ATOMIC_RELAXED); /* another thread may read it meanwhile */
  sleep_ms(n->ms);
}

/* Checks of uploads: an owner whose checks take long does not delay all uploads of another owner. */
static void test_tasks_take_turns(void **state) {
  (void)state;
  int next = 0;
  noted many[MANY], few[FEW], one = {.task = {.run = note, .owner = 3}, .ms = 5 * MANY_MS, .next = &next};
  tasks *pool = tasks_start(1, NULL);
  assert_non_null(pool);
  tasks_add(pool, &one.task); /* occupies the thread until all tasks are added */
  for (int i = 0; i < MANY; i++) {
    many[i] = (noted){.task = {.run = note, .owner = 1}, .ms = MANY_MS, .next = &next};
    tasks_add(pool, &many[i].task);
  }
  for (int i = 0; i < FEW; i++) {
    few[i] = (noted){.task = {.run = note, .owner = 2}, .ms = 0, .next = &next};
    tasks_add(pool, &few[i].task);
  }
  tasks_stop(pool);
  tasks_free(pool);
  assert_int_equal(next, 1 + MANY + FEW);
  assert_true(few[0].at <= 3);
  assert_true(few[1].at <= 4);
  for (int i = 1; i < MANY; i++) {
    assert_true(many[i].at > many[i - 1].at);
  }
  assert_true(few[1].at > few[0].at);
}

typedef struct heavy {
  task task;
  int64_t *in_use, *most;
} heavy;

static void weigh(task *t) {
  heavy *h = (heavy *)(void *)t;
  int64_t now = __atomic_add_fetch(h->in_use, t->memory, __ATOMIC_SEQ_CST), most;
  do {
    most = __atomic_load_n(h->most, __ATOMIC_SEQ_CST);
  } while (now > most && !__atomic_compare_exchange_n(h->most, &most, now, 0, __ATOMIC_SEQ_CST, __ATOMIC_SEQ_CST));
  sleep_ms(10);
  __atomic_sub_fetch(h->in_use, t->memory, __ATOMIC_SEQ_CST);
}

/* All tasks that run at once, in all pools together, stay within the memory of their part. A task for which there is no
 * memory lets others pass. */
static void test_tasks_share_memory(void **state) {
  (void)state;
  static const int64_t needs[] = {60, 60, 40, 60, 40, 100, 40, 40};
  enum { TASKS = sizeof needs / sizeof *needs };
  int64_t in_use = 0, most = 0;
  heavy all[TASKS];
  memory_budget *memory = budget_create(200);
  assert_non_null(memory);
  assert_int_equal(budget_most(memory, BUDGET_JOBS), 200);
  assert_int_equal(budget_most(memory, BUDGET_CHECKS), 100);
  assert_int_equal(budget_most(memory, BUDGET_SMALL), 50);
  tasks *pools[] = {tasks_start(4, memory), tasks_start(4, memory)};
  assert_true(pools[0] && pools[1]);
  for (int i = 0; i < TASKS; i++) {
    all[i] = (heavy){.task = {.run = weigh, .memory = needs[i], .part = BUDGET_CHECKS, .owner = (uint64_t)i % 3},
                     .in_use = &in_use,
                     .most = &most};
    tasks_add(pools[i % 2], &all[i].task);
  }
  tasks_stop(pools[0]);
  tasks_stop(pools[1]);
  tasks_free(pools[0]);
  tasks_free(pools[1]);
  assert_true(most <= 100);
  assert_true(most > 60); /* two at once, where they fit */
  assert_int_equal(budget_look(memory, BUDGET_CHECKS, 100, NULL), BUDGET_FREE);

  budget_destroy(memory);
  memory = budget_create(200);
  assert_non_null(memory);

  /* Beside a task that takes a whole part, another part still has room, and a smaller task passes a larger one. */
  most = 0;
  assert_int_equal(budget_take(memory, BUDGET_CHECKS, 70, NULL), BUDGET_FREE);
  assert_int_equal(budget_take(memory, BUDGET_CHECKS, 31, NULL), BUDGET_FULL);
  tasks *pool = tasks_start(1, memory);
  int next = 0;
  noted large = {.task = {.run = note, .memory = 31, .part = BUDGET_CHECKS}, .next = &next};
  noted small = {.task = {.run = note, .memory = 50, .part = BUDGET_SMALL}, .next = &next};
  tasks_add(pool, &large.task);
  tasks_add(pool, &small.task);
  for (int i = 0; i < 500 && __atomic_load_n(&next, __ATOMIC_SEQ_CST) == 0; i++) {
    sleep_ms(10);
  }
  budget_give(memory, BUDGET_CHECKS, 70, NULL); /* wakes the pool */
  tasks_stop(pool);
  tasks_free(pool);
  assert_int_equal(small.at, 0);
  assert_int_equal(large.at, 1);
  budget_destroy(memory);
}

/* The estimate for a file. */
static void test_memory_of_files(void **state) {
  (void)state;
  memory_budget *memory = budget_create(INT64_C(4) << 30);
  assert_non_null(memory);
  assert_int_equal(budget_for_file(memory, BUDGET_CHECKS, 1000000), (4 << 20) + 9000000);
  assert_int_equal(budget_for_densest_file(memory, BUDGET_CHECKS, 1000000, 0), (4 << 20) + 200000000);
  assert_int_equal(budget_for_densest_file(memory, BUDGET_CHECKS, 1000, 1), (4 << 20) + 200000 + 7200000);
  assert_int_equal(budget_for_densest_file(memory, BUDGET_CHECKS, 100000, 1), (4 << 20) + 20000000 + (160 << 20));
  assert_int_equal(budget_for_densest_file(memory, BUDGET_CHECKS, INT64_C(1) << 60, 0), INT64_C(2) << 30);
  assert_int_equal(budget_for_densest_file(memory, BUDGET_SMALL, 5000000, 0), (4 << 20) + 1000000000);
  budget_destroy(memory);
  /* Two files of load.mjs are checked side by side. */
  memory = budget_create(512 << 20);
  assert_non_null(memory);
  const int64_t one = budget_for_file(memory, BUDGET_CHECKS, 13400000);
  assert_int_equal(budget_take(memory, BUDGET_CHECKS, one, NULL), BUDGET_FREE);
  assert_int_equal(budget_take(memory, BUDGET_CHECKS, one, NULL), BUDGET_FREE);
  assert_int_equal(budget_take(memory, BUDGET_CHECKS, one, NULL), BUDGET_FULL);
  budget_destroy(memory);
}

static void count_call(void *user) {
  ++*(int *)user;
}

/* Listeners are told of memory that a task requested in vain, once for each request, and of no other memory. */
static void test_listeners(void **state) {
  (void)state;
  int calls = 0;
  memory_budget *memory = budget_create(200);
  assert_non_null(memory);
  budget_listen(memory, count_call, &calls);
  assert_int_equal(budget_take(memory, BUDGET_CHECKS, 60, NULL), BUDGET_FREE);
  const unsigned before = budget_shortages(memory, BUDGET_CHECKS);
  budget_give(memory, BUDGET_CHECKS, 10, NULL);
  assert_int_equal(calls, 0);
  assert_int_equal(budget_look(memory, BUDGET_CHECKS, 60, NULL), BUDGET_FULL);
  assert_true(budget_shortages(memory, BUDGET_CHECKS) != before);
  budget_give(memory, BUDGET_CHECKS, 10, NULL);
  assert_int_equal(calls, 1);
  budget_give(memory, BUDGET_CHECKS, 10, NULL);
  assert_int_equal(calls, 1);
  assert_int_equal(budget_take(memory, BUDGET_SMALL, 51, NULL), BUDGET_FULL);
  budget_give(memory, BUDGET_CHECKS, 30, NULL); /* another part */
  assert_int_equal(calls, 1);
  budget_destroy(memory);
}

/* A job that needs all memory of jobs waits for a check. Later large checks leave it room, until it has its memory or
 * is cancelled; small ones do not wait. */
static void test_a_job_claims_memory(void **state) {
  stored *s = *state;
  const int64_t all = INT64_C(4) << 30, beside = 64 << 20;
  for (int is_cancelled = 0; is_cancelled < 2; is_cancelled++) {
    memory_budget *memory = budget_create(all);
    assert_non_null(memory);
    const queue_options options = {.workers = 2, .cores = 2, .limit = 1000, .memory = memory};
    queue *q = queue_create(&options, s->cat);
    assert_non_null(q);
    assert_int_equal(budget_take(memory, BUDGET_CHECKS, all / 4, NULL), BUDGET_FREE);
    submit(s, q, "large", all);
    job *waiting = q->last;
    assert_null(look(q));
    assert_int_equal(budget_look(memory, BUDGET_CHECKS, beside, NULL), BUDGET_OTHERS);
    assert_int_equal(budget_look(memory, BUDGET_SMALL, beside, NULL), BUDGET_FREE);
    if (is_cancelled) {
      assert_int_equal(queue_cancel(q, waiting), STORE_OK);
    } else {
      budget_give(memory, BUDGET_CHECKS, all / 4, NULL);
      job *large = take(q, "large");
      assert_int_equal(large->memory, all);
      assert_int_equal(budget_look(memory, BUDGET_CHECKS, all / 4, NULL), BUDGET_OTHERS);
      end_after(q, large, SECOND);
    }
    assert_int_equal(budget_look(memory, BUDGET_CHECKS, all / 4, NULL), BUDGET_FREE);
    queue_destroy(q);
    budget_destroy(memory);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(test_time_decides, setup, teardown),
      cmocka_unit_test_setup_teardown(test_measure_replaces_estimate, setup, teardown),
      cmocka_unit_test_setup_teardown(test_running_jobs_count, setup, teardown),
      cmocka_unit_test_setup_teardown(test_share, setup, teardown),
      cmocka_unit_test_setup_teardown(test_pauses_earn_nothing, setup, teardown),
      cmocka_unit_test_setup_teardown(test_given_back, setup, teardown),
      cmocka_unit_test_setup_teardown(test_a_stop_before_the_context, setup, teardown),
      cmocka_unit_test_setup_teardown(test_guests_pass_a_suspect, setup, teardown),
      cmocka_unit_test_setup_teardown(test_a_suspect_is_no_guest, setup, teardown),
      cmocka_unit_test_setup_teardown(test_a_suspect_waits_only_so_long, setup, teardown),
      cmocka_unit_test_setup_teardown(test_others_wait_only_so_long, setup, teardown),
      cmocka_unit_test_setup_teardown(test_nobody_is_blamed, setup, teardown),
      cmocka_unit_test_setup_teardown(test_a_job_claims_memory, setup, teardown),
      cmocka_unit_test(test_tasks_take_turns),
      cmocka_unit_test(test_tasks_share_memory),
      cmocka_unit_test(test_memory_of_files),
      cmocka_unit_test(test_listeners),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
