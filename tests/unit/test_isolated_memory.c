/* The memory of all processes together, where each takes all of its budget and keeps it, a part of it as results. This
 * program is its own zygote, whose processes fill a context of core. ORB_MEMORY_ALL=1 adds a job-memory of 4 GB. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>
#include <sodium.h>

#include "budget.h"
#include "isolate/sandbox.h"
#include "isolate/task.h"
#include "log.h"
#include "store/object_removal.h"
#include "store/objects_remote.h"

enum { PROCESSES = 16 };
static const int64_t MB = 1 << 20;
static const int64_t BESIDE = 300;   /* MB: that all processes may take besides job-memory */
static const int64_t OF_DAEMON = 60; /* MB of it: for the daemon, which this program is not (docs/limits.md) */

/* ---- the process ---- */

enum { LARGE = (16 << 20) - 128, SMALL = 1 << 12 }; /* bytes of a block; 128: that core adds */

/* Fills the heap with up to `most` bytes, and frees them: the heap keeps what it can. */
static void fill_heap(orb_context *ctx, size_t most) {
  enum { BLOCKS = 1 << 16 };
  static void *blocks[BLOCKS];
  int count = 0;
  while (count < BLOCKS && orb_memory_used(ctx) < most && (blocks[count] = orb_alloc(ctx, SMALL, 1)) != NULL) {
    memset(blocks[count++], 1, SMALL);
  }
  while (count > 0) {
    orb_free(ctx, blocks[--count]);
  }
}

static store_result publish(void *user, object_kind kind, const char *id, int64_t start, int64_t size) {
  (void)user, (void)kind, (void)id, (void)start, (void)size;
  return STORE_OK;
}

/* Writes results of so many bytes, as far as the budget allows; returns how many are in memory. */
static int64_t keep_results(orb_context *ctx, int file, int64_t most) {
  static char part[1 << 20];
  const objects_remote remote = {.publish = publish, .ctx = ctx, .file = file};
  objects *store;
  object_temp temp;
  struct stat info;
  if (objects_open_remote(&remote, &store) != STORE_OK || objects_begin(store, &temp) != STORE_OK) {
    _exit(9);
  }
  for (int64_t bytes = 0; bytes < most && objects_append(&temp, part, sizeof part) == STORE_OK;) {
    bytes += (int64_t)sizeof part;
  }
  return fstat(file, &info) == 0 ? (int64_t)info.st_blocks * 512 : INT64_MAX;
}

/* Takes what its budget allows, up to half of it for results and the rest in blocks that core maps and in blocks that
 * malloc() serves, and waits. */
_Noreturn static void fill(int channel) {
  frame f;
  task_head task;
  orb_context *ctx;
  done_head done = {0};
  if (channel_receive(channel, CHANNEL_MOST, &f, NULL, NULL) != CHANNEL_OK || f.size != sizeof task) {
    _exit(9);
  }
  memcpy(&task, f.bytes, sizeof task);
  const int results = task_confine(channel, &task);
  orb_keep_heap();
  if (orb_context_create(&(orb_context_options){.memory_limit = (size_t)task.memory, .threads = 1}, &ctx) != ORB_OK) {
    _exit(9);
  }
  fill_heap(ctx, 100 * (size_t)MB);
  done.flips = keep_results(ctx, results, task.memory / 2);
  for (size_t block = LARGE; block > 0; block = block == LARGE ? SMALL : 0) {
    for (void *at; (at = orb_alloc(ctx, block, 1)) != NULL;) {
      memset(at, 1, block);
    }
  }
  done.bytes = (int64_t)orb_memory_used(ctx);
  if (task_answer(channel, &done, NULL, NULL) != CHANNEL_OK) {
    _exit(9);
  }
  (void)channel_receive(channel, CHANNEL_MOST, &f, NULL, NULL);
  _exit(0);
}

/* ---- this program ---- */

typedef struct crowd {
  memory_budget *budget;
  orb_context *ctx;
  isolated all[PROCESSES];
  int count;
  int64_t bytes;   /* in their contexts */
  int64_t results; /* of that, in files */
} crowd;

/* Starts a process with so many bytes of a part, if there is room. */
static int join(crowd *c, budget_part part, int64_t bytes) {
  bytes = bytes < budget_most(c->budget, part) ? bytes : budget_most(c->budget, part);
  if (c->count == PROCESSES || budget_take(c->budget, part, bytes, NULL) != BUDGET_FREE) {
    return 0;
  }
  const task_head task = {.kind = TASK_EMBEDDING, .threads = 1, .limit = bytes, .memory = bytes, .cpu_seconds = 100};
  const struct iovec frame_part = {(void *)(uintptr_t)&task, sizeof task};
  frame f;
  done_head done;
  isolated *p = &c->all[c->count++];
  assert_true(isolate_open(p, c->ctx));
  assert_int_equal(isolate_send(p, FRAME_TASK, &frame_part, 1, -1), CHANNEL_OK);
  assert_int_equal(isolate_receive(p, CHANNEL_ANSWER_MOST, &f), CHANNEL_OK);
  memcpy(&done, f.bytes, sizeof done);
  frame_free(&f);
  assert_in_range(done.bytes, bytes - bytes / 16 - 16384, bytes);
  assert_in_range(done.flips, bytes / 2 - MB, bytes / 2 + MB);
  c->bytes += done.bytes;
  c->results += done.flips;
  return 1;
}

/* As much of a part as fits: halves what it asks for, down to 4 MB. */
static void join_all(crowd *c, budget_part part, int64_t bytes, int most) {
  for (int i = 0; bytes >= 4 * MB && i < most;) {
    const int joined = join(c, part, bytes);
    i += joined;
    bytes = joined ? bytes : bytes / 2;
  }
}

/* Kilobytes of a process and its descendants; what they share counts once. */
static long resident(long pid) {
  char path[64], line[256];
  long kilobytes = 0, child;
  snprintf(path, sizeof path, "/proc/%ld/smaps_rollup", pid);
  FILE *file = fopen(path, "r");
  assert_non_null(file);
  while (fgets(line, sizeof line, file) && sscanf(line, "Pss: %ld", &kilobytes) != 1) {
  }
  fclose(file);
  snprintf(path, sizeof path, "/proc/%ld/task/%ld/children", pid, pid);
  file = fopen(path, "r");
  assert_non_null(file);
  while (fscanf(file, "%ld", &child) == 1) {
    kilobytes += resident(child);
  }
  fclose(file);
  return kilobytes;
}

/* Two workers, their jobs, large files, small files and guests, in an order in which each part takes all that it can.
 */
static void measure(int64_t job_memory, int jobs_first) {
  crowd c = {.budget = budget_create(job_memory)};
  assert_true(c.budget && orb_context_create(&(orb_context_options){.threads = 1}, &c.ctx) == ORB_OK);
  assert_true(isolate_start(ISOLATE_ON));
  if (jobs_first) {
    join_all(&c, BUDGET_JOBS, job_memory / 2, 2);
  }
  join_all(&c, BUDGET_CHECKS, job_memory / 4, 2);
  if (!jobs_first) {
    join_all(&c, BUDGET_JOBS, job_memory / 2, 2);
  }
  join_all(&c, BUDGET_SMALL, budget_for_densest_file(c.budget, BUDGET_SMALL, BUDGET_SMALL_FILE, 0), 8);
  join_all(&c, BUDGET_SMALL, 64 * MB, 2);
  const long all = resident(getpid()) / 1024 + (long)(c.results / MB), own = (long)(c.bytes / MB);
  print_message("job-memory %ld MB: %d processes with budgets of %ld MB take %ld MB, job-memory and %ld\n",
                (long)(job_memory / MB), c.count, own, all, all - (long)(job_memory / MB));
  assert_true(own > job_memory / MB);
  assert_true(all > own - own / 16); /* all is in memory, but the ends of blocks */
  assert_true(all <= job_memory / MB + BESIDE - OF_DAEMON);
  for (int i = 0; i < c.count; i++) {
    isolate_close(&c.all[i]);
  }
  isolate_stop();
  orb_context_destroy(c.ctx);
  budget_destroy(c.budget);
}

static void test_all_at_their_most(void **state) {
  (void)state;
  if (SANDBOX_SANITIZED) {
    skip(); /* they take memory of their own */
  }
  static const int64_t sizes[] = {64, 400, 1024, 4096};
  const int count = getenv("ORB_MEMORY_ALL") ? 4 : 3;
  for (int i = 0; i < count; i++) {
    measure(sizes[i] * MB, 1);
    measure(sizes[i] * MB, 0);
  }
}

int main(int count, char **arguments) {
  if (count > 1 && strcmp(arguments[1], ISOLATE_FLAG) == 0) {
    isolate_zygote(fill);
  }
  log_setup(LOG_ERROR, 0);
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_all_at_their_most)};
  return sodium_init() < 0 ? 1 : cmocka_run_group_tests(tests, NULL, NULL);
}
