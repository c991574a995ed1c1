/* A process that a file has taken over answers a check or a conversion with what no process sends. Each such end counts
 * as a crash of that work. This program is its own zygote. */
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cmocka.h>
#include <sodium.h>

#include "convert.h"
#include "intake.h"
#include "log.h"
#include "store/crashes.h"

enum { CRASHES = 3 }; /* after which work is refused */

/* ---- the process ---- */

static const char killed[] = "v 9 9 9\n"; /* the file whose check is killed */

/* A result without what belongs to it. Then it waits until the daemon ends it. */
static void answer(int channel) {
  frame f;
  done_head done = {.fine = 1};
  if (channel_receive(channel, CHANNEL_MOST, &f, NULL, NULL) != CHANNEL_OK) {
    _exit(9);
  }
  if (f.size == sizeof(task_head) + sizeof killed - 1 &&
      memcmp(f.bytes + sizeof(task_head), killed, sizeof killed - 1) == 0) {
    raise(SIGKILL);
  }
  if (task_answer(channel, &done, "{}", NULL) != CHANNEL_OK) {
    _exit(9);
  }
  for (;;) {
    pause();
  }
}

/* ---- the daemon ---- */

typedef struct daemon_state {
  char data[40];
  objects *store;
  catalogue *cat;
  orb_context *ctx;
  int log, kept; /* standard error goes to the file in memory `log` */
} daemon_state;

static int setup(void **state) {
  daemon_state *s = calloc(1, sizeof *s);
  strcpy(s->data, "/tmp/orbmorph-checks-XXXXXX");
  if (!mkdtemp(s->data) || objects_open(s->data, &s->store) != STORE_OK ||
      catalogue_open(s->data, &s->cat) != STORE_OK || !isolate_start(ISOLATE_ON) ||
      orb_context_create(&(orb_context_options){.threads = 1}, &s->ctx) != ORB_OK) {
    return -1;
  }
  s->log = memfd_create("log", MFD_CLOEXEC);
  s->kept = dup(STDERR_FILENO);
  dup2(s->log, STDERR_FILENO);
  *state = s;
  return 0;
}

static int teardown(void **state) {
  daemon_state *s = *state;
  char command[80];
  dup2(s->kept, STDERR_FILENO);
  close(s->kept);
  close(s->log);
  isolate_stop();
  orb_context_destroy(s->ctx);
  catalogue_close(s->cat);
  objects_close(s->store);
  snprintf(command, sizeof command, "rm -rf %s", s->data);
  const int failed = system(command);
  free(s);
  return failed;
}

static void expect_log(const daemon_state *s, const char *text) {
  char log[8192];
  const ssize_t size = pread(s->log, log, sizeof log - 1, 0);
  assert_true(size > 0);
  log[size] = 0;
  if (!strstr(log, text)) {
    fail_msg("the log lacks \"%s\":\n%s", text, log);
  }
}

/* Counts are written later, but in order: another write waits for them. */
static void expect_crashed(const daemon_state *s, const api_problem *problem) {
  assert_int_equal(catalogue_crash_clear(s->cat, "nobody"), STORE_NOT_FOUND);
  assert_non_null(problem->name);
  assert_string_equal(problem->name, "job-crashed");
}

static void open_text(const daemon_state *s, const char *text, object_temp *temp, intake_file *file) {
  static const api_upload upload = {.name = "a"};
  const int64_t size = (int64_t)strlen(text);
  api_hash hash;
  assert_int_equal(objects_begin(s->store, temp), STORE_OK);
  assert_int_equal(objects_append(temp, text, (size_t)size), STORE_OK);
  api_hash_begin(&hash);
  api_hash_add(&hash, text, (size_t)size);
  assert_true(intake_open(file, temp, &hash, size, &upload));
}

static void check(const daemon_state *s, const intake_file *file) {
  const intake_limits limits = {.memory = 64 << 20, .max_triangles = 1000};
  intake_stored stored;
  api_problem problem = {0};
  assert_int_equal(intake_store(file, s->cat, s->store, s->ctx, &limits, "evil", 0, &stored, &problem), STORE_OK);
  expect_crashed(s, &problem);
  api_problem_free(&problem);
}

static void test_a_check(void **state) {
  const daemon_state *s = *state;
  object_temp temp;
  intake_file file;
  open_text(s, "v 0 0 0\n", &temp, &file);
  for (int i = 0; i < CRASHES; i++) {
    assert_false(catalogue_crashed(s->cat, file.id));
    check(s, &file);
  }
  assert_true(catalogue_crashed(s->cat, file.id));
  expect_log(s, "broke the protocol: an answer that does not fit the check");
  intake_close(&file);
  objects_abandon(&temp);
}

/* Where memory is short the kernel kills a process, and others may have taken the memory: only a check that is killed
 * while no other process works counts. */
static void test_a_check_that_is_killed(void **state) {
  const daemon_state *s = *state;
  object_temp temp;
  intake_file file;
  isolated other;
  open_text(s, killed, &temp, &file);
  assert_true(isolate_open(&other, s->ctx));
  for (int i = 0; i <= CRASHES; i++) {
    check(s, &file);
    assert_false(catalogue_crashed(s->cat, file.id));
  }
  expect_log(s, "was killed by signal 9");
  isolate_close(&other);
  for (int i = 0; i < CRASHES; i++) {
    assert_false(catalogue_crashed(s->cat, file.id));
    check(s, &file);
  }
  assert_true(catalogue_crashed(s->cat, file.id));
  intake_close(&file);
  objects_abandon(&temp);
}

static void test_a_conversion(void **state) {
  const daemon_state *s = *state;
  const convert_limits limits = {.memory = 64 << 20};
  char id[API_ID_SIZE];
  memset(id, 'a', sizeof id - 1);
  id[sizeof id - 1] = 0;
  const int asset = memfd_create("asset", MFD_CLOEXEC);
  for (int i = 0; i <= CRASHES; i++) {
    api_problem problem = {0};
    object_temp temp;
    assert_false(
        convert_asset(s->cat, s->store, s->ctx, id, (orb_profile)0, asset, 1, "evil", &limits, &temp, &problem));
    expect_crashed(s, &problem);
    assert_true((i == CRASHES) == (strstr(problem.detail, "Three processes") != NULL));
    api_problem_free(&problem);
  }
  expect_log(s, "broke the protocol: an end that does not fit the conversion");
  close(asset);
}

int main(int count, char **arguments) {
  if (count > 1 && strcmp(arguments[1], ISOLATE_FLAG) == 0) {
    isolate_zygote(answer);
  }
  log_setup(LOG_ERROR, 0);
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(test_a_check, setup, teardown),
      cmocka_unit_test_setup_teardown(test_a_check_that_is_killed, setup, teardown),
      cmocka_unit_test_setup_teardown(test_a_conversion, setup, teardown),
  };
  return sodium_init() < 0 ? 1 : cmocka_run_group_tests(tests, NULL, NULL);
}
