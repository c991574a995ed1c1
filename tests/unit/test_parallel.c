/* Parallel loops: every index once, in chunks that do not depend on the threads, whichever thread is late. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "base/parallel.h"
#include "orbmorph/context.h"

enum { MOST = 5000, THREADS = 9 };

typedef struct record {
  atomic_int times[MOST]; /* that an index was run */
  int64_t start, count, grain;
  atomic_int wrong;       /* chunks that begin or end elsewhere, or have no such thread */
  atomic_int by[THREADS]; /* chunks by thread */
  int slow, threads;      /* the thread that sleeps in each chunk, −1: none; of the context */
} record;

/* Takes about a tenth of a microsecond: a loop of a few hundred is worth sharing. */
static void work(void) {
  for (volatile int i = 0; i < 100; i++) {
  }
}

static void run(void *arg, int64_t begin, int64_t end, int thread) {
  record *r = arg;
  int64_t offset = begin - r->start, stop = offset + r->grain < r->count ? offset + r->grain : r->count;
  int fine = offset >= 0 && offset % r->grain == 0 && end - r->start == stop && thread >= 0 && thread < r->threads;
  atomic_fetch_add(&r->wrong, !fine);
  for (int64_t i = begin; fine && i < end; i++) {
    atomic_fetch_add(&r->times[i - r->start], 1);
    work();
  }
  if (fine) {
    atomic_fetch_add(&r->by[thread], 1);
  }
  if (thread == r->slow) {
    const struct timespec pause = {.tv_nsec = 2000000};
    nanosleep(&pause, NULL);
  }
}

static orb_context *context_of(int threads) {
  const orb_context_options options = {.threads = threads};
  orb_context *made;
  assert_int_equal(orb_context_create(&options, &made), ORB_OK);
  return made;
}

/* Runs a loop and checks that each index was run once. Returns how many chunks thread 0 has run. */
static int check_loop(orb_context *made, record *r, int64_t start, int64_t count, int64_t grain) {
  memset(r->times, 0, sizeof r->times);
  memset(r->by, 0, sizeof r->by);
  r->start = start;
  r->count = count;
  r->grain = grain;
  r->wrong = 0;
  orb_parallel_slice(made, start, count, grain, run, r);
  assert_int_equal(atomic_load(&r->wrong), 0);
  for (int64_t i = 0; i < MOST; i++) {
    assert_int_equal(atomic_load(&r->times[i]), i < count);
  }
  return atomic_load(&r->by[0]);
}

static void each_index_once(void **state) {
  (void)state;
  static record r;
  static const int64_t counts[] = {0, 1, 2, 3, 7, 64, 65, 1000, MOST}, grains[] = {1, 2, 7, 128, MOST};
  for (int threads = 1; threads <= THREADS; threads += threads < 3 ? 1 : 3) {
    orb_context *made = context_of(threads);
    r.threads = threads;
    r.slow = -1;
    for (int round = 0; round < 20; round++) {
      for (size_t c = 0; c < sizeof counts / sizeof *counts; c++) {
        for (size_t g = 0; g < sizeof grains / sizeof *grains; g++) {
          check_loop(made, &r, 13 * round, counts[c], grains[g]);
        }
      }
    }
    orb_context_destroy(made);
  }
}

/* A thread that is slow, the caller among them, does not keep the others from its chunks. A busy machine may let the
 * other thread run too late once, but not each time. */
static void others_take_over(void **state) {
  (void)state;
  enum { TRIES = 20 };
  static record r;
  orb_context *made = context_of(2);
  r.threads = 2;
  for (r.slow = 0; r.slow < 2; r.slow++) {
    const int least = r.slow ? 40 : 1, most = r.slow ? 60 : 20;
    int own = -1;
    for (int i = 0; i < TRIES && (own < least || own > most); i++) {
      own = check_loop(made, &r, 0, 60, 1);
    }
    assert_in_range(own, least, most);
  }
  orb_context_destroy(made);
}

/* Sums that are taken by chunk are the same for any number of threads: loops follow each other closely here, so a
 * thread may come late to any of them. */
typedef struct sums {
  const double *value;
  double of_chunk[MOST];
} sums;

static void add(void *arg, int64_t begin, int64_t end, int thread) {
  sums *s = arg;
  (void)thread;
  s->of_chunk[begin / 7] = 0;
  for (int64_t i = begin; i < end; i++) {
    s->of_chunk[begin / 7] += s->value[i] + s->of_chunk[begin / 7] * 1e-3;
    work();
  }
}

static void close_loops_agree(void **state) {
  (void)state;
  static double value[MOST];
  static sums s[2] = {{.value = value}, {.value = value}};
  for (int i = 0; i < MOST; i++) {
    value[i] = 1.0 / (1 + i);
  }
  orb_context *one = context_of(1), *many = context_of(4);
  for (int round = 0; round < 3000; round++) {
    int64_t count = 1 + (int64_t)round * 37 % MOST;
    orb_parallel_for(one, count, 7, add, &s[0]);
    orb_parallel_for(many, count, 7, add, &s[1]);
    assert_memory_equal(s[0].of_chunk, s[1].of_chunk, (size_t)((count + 6) / 7) * sizeof(double));
  }
  orb_context_destroy(one);
  orb_context_destroy(many);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(each_index_once), cmocka_unit_test(others_take_over),
                                     cmocka_unit_test(close_loops_agree)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
