/* The memory of the results of a job's process. This program is its own zygote, whose processes send two objects in one
 * file in memory and tell how much of it was in memory at most. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>
#include <sodium.h>

#include "isolate/task.h"
#include "log.h"
#include "store/object_removal.h"
#include "worker/isolated.h"

/* OBJECT_BYTES: of each, so that the second begins within a page. EARLY: of the second that are written before the
 * first is sent. WAIT_MS: for the daemon, on the busiest machine. */
enum { OBJECT_BYTES = (8 << 20) + 100, EARLY = 50, WAIT_MS = 20000 };

/* ---- the process ---- */

static void fill(int results, int letter, size_t bytes) {
  static char part[1 << 16];
  memset(part, letter, sizeof part);
  while (bytes > 0) {
    const ssize_t n = write(results, part, bytes < sizeof part ? bytes : sizeof part);
    if (n <= 0) {
      _exit(9);
    }
    bytes -= (size_t)n;
  }
}

static int64_t in_memory(int results) {
  struct stat info;
  return fstat(results, &info) == 0 ? (int64_t)info.st_blocks * 512 : INT64_MAX;
}

/* Waits until the daemon has freed the first object. Then only the second is in memory. */
static void work(int channel) {
  frame f;
  task_head task;
  done_head done = {.fine = 1, .bytes = 2 * (int64_t)OBJECT_BYTES};
  if (channel_receive(channel, CHANNEL_MOST, &f, NULL, NULL) != CHANNEL_OK || f.size < sizeof task) {
    _exit(9);
  }
  memcpy(&task, f.bytes, sizeof task);
  do {
    frame_free(&f);
  } while (channel_receive(channel, CHANNEL_MOST, &f, NULL, NULL) == CHANNEL_OK && f.type != FRAME_GO);
  const int results = memfd_create("results", MFD_CLOEXEC);
  fill(results, 'a', OBJECT_BYTES);
  fill(results, 'b', EARLY);
  if (task_send_object(channel, results, OBJECT_ASSET, task.key, 0, OBJECT_BYTES) != CHANNEL_OK) {
    _exit(9);
  }
  for (int waited = 0; waited < WAIT_MS && in_memory(results) >= OBJECT_BYTES; waited++) {
    usleep(1000);
  }
  fill(results, 'b', OBJECT_BYTES - EARLY);
  done.flips = in_memory(results);
  if (task_send_object(channel, results, OBJECT_PLACES, task.key, OBJECT_BYTES, OBJECT_BYTES) != CHANNEL_OK) {
    _exit(9);
  }
  task_end(channel, &done, "{}", NULL);
}

/* ---- the daemon ---- */

static void expect_object(const objects *store, object_kind kind, const char *id, int letter) {
  unsigned char *bytes;
  size_t size;
  assert_int_equal(objects_load(store, kind, id, &bytes, &size), STORE_OK);
  assert_int_equal(size, OBJECT_BYTES);
  for (size_t i = 0; i < size; i++) {
    if (bytes[i] != letter) {
      fail_msg("byte %zu is %d", i, bytes[i]);
    }
  }
  free(bytes);
}

static void test_two_results(void **state) {
  char data[] = "/tmp/orbmorph-results-XXXXXX", key[API_ID_SIZE], command[64];
  run_env env = {.tenant = ""};
  job_progress progress = {0};
  orb_context *ctx;
  (void)state;
  assert_non_null(mkdtemp(data));
  assert_int_equal(objects_open(data, &env.store), STORE_OK);
  assert_int_equal(catalogue_open(data, &env.cat), STORE_OK);
  assert_true(isolate_start(ISOLATE_ON));
  assert_int_equal(orb_context_create(&(orb_context_options){.threads = 1}, &ctx), ORB_OK);
  env.progress = &progress;
  memset(key, 'a', sizeof key - 1);
  key[sizeof key - 1] = 0;
  const run_job j = {.key = key, .request = "{}"};
  const isolated_limits limits = {
      .memory = 64 << 20, .threads = 1, .max_triangles = 1000, .hold_ms = (int64_t)2 * WAIT_MS};
  run_output out = {0};
  api_problem problem = {0};
  isolated_end end = {0};
  if (!isolated_run(&env, ctx, API_JOB_SUPERMESH, &j, &limits, &out, &problem, &end)) {
    fail_msg("the process %s", end.why);
  }
  objects_let_go(env.store);
  print_message("of two results of %d bytes each, %ld were in memory\n", OBJECT_BYTES, (long)out.flips);
  assert_in_range(out.flips, OBJECT_BYTES, OBJECT_BYTES + OBJECT_BYTES / 8);
  expect_object(env.store, OBJECT_ASSET, key, 'a');
  expect_object(env.store, OBJECT_PLACES, key, 'b');
  resource_free(&out.row);
  isolate_stop();
  orb_context_destroy(ctx);
  catalogue_close(env.cat);
  objects_close(env.store);
  snprintf(command, sizeof command, "rm -rf %s", data);
  assert_int_equal(system(command), 0);
}

int main(int count, char **arguments) {
  if (count > 1 && strcmp(arguments[1], ISOLATE_FLAG) == 0) {
    isolate_zygote(work);
  }
  log_setup(LOG_ERROR, 0);
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_two_results)};
  return sodium_init() < 0 ? 1 : cmocka_run_group_tests(tests, NULL, NULL);
}
