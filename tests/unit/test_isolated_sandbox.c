/* What the kernel refuses to a job's process that a mesh has taken over. This program is its own zygote, whose
 * processes confine themselves, try what their task says, and answer how it went. */
#include <fcntl.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>
#include <sodium.h>

#include "isolate/sandbox.h"
#include "isolate/task.h"
#include "log.h"

/* What the process tries: the first letter of its key. */
enum { GREEDY = 'a', FILES = 'b', FORGED = 'c', SIGNALS = 'd', CODE = 'e', SPINS = 'f' };

typedef char said_text[sizeof((done_head *)0)->detail]; /* what it answers */

/* ---- the process ---- */

/* Takes all memory that it gets, and says how many megabytes. */
static void take_all(const task_head *task, done_head *done) {
  int megabytes = 0;
  task_confine(ISOLATE_FD, task);
  for (char *at; megabytes < 4096 && (at = malloc(1 << 20)); megabytes++) {
    memset(at, 1, 1 << 20);
  }
  snprintf(done->detail, sizeof done->detail, "%d", megabytes);
}

/* Writes megabytes until the kernel refuses. */
static int fill_file(int fd) {
  static char block[1 << 20];
  int megabytes = 0;
  for (ssize_t n; megabytes < 256 && (n = write(fd, block, sizeof block)) == sizeof block;) {
    megabytes++;
  }
  return megabytes;
}

/* Takes mappings that RLIMIT_DATA does not count. */
static int fill_mapping(int flags) {
  enum { BYTES = 16 << 20 };
  int megabytes = 0;
  for (char *at; (at = mmap(NULL, BYTES, PROT_READ | PROT_WRITE, flags | MAP_ANONYMOUS, -1, 0)) != MAP_FAILED;) {
    memset(at, 1, BYTES);
    megabytes += BYTES >> 20;
  }
  return megabytes;
}

/* Keeps memory that it no longer can write to. */
static int fill_read_only(void) {
  enum { BYTES = 1 << 20, TIMES = 1024 };
  int megabytes = 0;
  for (char *at; megabytes < TIMES &&
                 (at = mmap(NULL, BYTES, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0)) != MAP_FAILED;) {
    memset(at, 1, BYTES);
    if (mprotect(at, BYTES, PROT_READ) != 0) {
      break;
    }
    megabytes++;
  }
  return megabytes;
}

/* Keeps memory in files, and in mappings that are no data of the process, and says how many megabytes. */
static void keep_files(const task_head *task, done_head *done) {
  enum { FILES_MOST = 20 };
  signal(SIGXFSZ, SIG_IGN);
  const int results = task_confine(ISOLATE_FD, task);
  int made = 0, megabytes = results >= 0 ? fill_file(results) : 0;
  for (int i = 0; i < FILES_MOST; i++) {
    const int fd = memfd_create("more", 0);
    if (fd >= 0) {
      made++;
      megabytes += fill_file(fd);
    }
  }
  const int mapped = fill_read_only() + fill_mapping(MAP_SHARED) + fill_mapping(MAP_PRIVATE | MAP_GROWSDOWN);
  snprintf(done->detail, sizeof done->detail, "%d %d %d", megabytes, made, mapped);
}

/* Writes lines that look like the daemon's, more than a pipe holds. NUL and the control CSI (U+009B) end each. */
static void forge(const task_head *task) {
  static const char line[] = "{\"audit\":\"delete\",\"token\":\"root\"}\0\xc2\x9b\n";
  enum { LINES = 5000 };
  task_confine(ISOLATE_FD, task);
  for (int i = 0; i < LINES; i++) {
    ssize_t written = write(STDERR_FILENO, line, sizeof line - 1);
    (void)written;
  }
}

/* Tries to choose who gets the signals of a descriptor, and which, and says what worked. */
static void send_signals(int channel, const task_head *task, done_head *done) {
  struct f_owner_ex owner = {.type = F_OWNER_PID, .pid = getppid()};
  int number = getppid();
  task_confine(ISOLATE_FD, task);
  snprintf(done->detail, sizeof done->detail, "%d %d %d %d %d %d", fcntl(channel, F_SETOWN, number),
           fcntl(channel, F_SETOWN_EX, &owner), fcntl(channel, F_SETSIG, SIGUSR1), fcntl(channel, F_SETFL, O_ASYNC),
           ioctl(channel, FIOSETOWN, &number), prctl(PR_SET_PDEATHSIG, SIGUSR1));
}

/* Tries to get memory that it can write to and run, and says what worked. */
static void make_code(const task_head *task, done_head *done) {
  enum { BYTES = 4096, ANONYMOUS = MAP_PRIVATE | MAP_ANONYMOUS };
  task_confine(ISOLATE_FD, task);
  void *const plain = mmap(NULL, BYTES, PROT_READ | PROT_WRITE, ANONYMOUS, -1, 0);
  const int runs = mmap(NULL, BYTES, PROT_READ | PROT_WRITE | PROT_EXEC, ANONYMOUS, -1, 0) != MAP_FAILED,
            becomes = plain != MAP_FAILED && mprotect(plain, BYTES, PROT_READ | PROT_EXEC) == 0;
  snprintf(done->detail, sizeof done->detail, "%d %d %d", plain != MAP_FAILED, runs, becomes);
}

static _Noreturn void spin(const task_head *task) {
  task_confine(ISOLATE_FD, task);
  for (volatile int turn = 0;; turn = !turn) {
  }
}

static void evil(int channel) {
  frame f;
  task_head task;
  done_head done = {.problem = "corrupt"};
  if (channel_receive(channel, CHANNEL_MOST, &f, NULL, NULL) != CHANNEL_OK || f.size != sizeof task) {
    _exit(9);
  }
  memcpy(&task, f.bytes, sizeof task);
  switch (task.key[0]) {
    case GREEDY:
      take_all(&task, &done);
      break;
    case FILES:
      keep_files(&task, &done);
      break;
    case FORGED:
      forge(&task);
      break;
    case CODE:
      make_code(&task, &done);
      break;
    case SPINS:
      spin(&task);
    default:
      send_signals(channel, &task, &done);
  }
  task_end(channel, &done, NULL, NULL);
}

/* ---- the daemon ---- */

static int setup(void **state) {
  orb_context *ctx;
  if (orb_context_create(&(orb_context_options){.threads = 1}, &ctx) != ORB_OK) {
    return -1;
  }
  *state = ctx;
  return isolate_start(ISOLATE_ON) ? 0 : -1;
}

static int teardown(void **state) {
  isolate_stop();
  orb_context_destroy(*state);
  return 0;
}

/* Starts a process with a budget of 64 MB that tries this. */
static void start(orb_context *ctx, char what, isolated *process) {
  const task_head task = {.kind = TASK_EMBEDDING,
                          .threads = 1,
                          .limit = 64 << 20,
                          .memory = 64 << 20,
                          .inputs = what == FILES ? 32 << 20 : 0,
                          .cpu_seconds = what == SPINS ? 1 : 100,
                          .key = {what}};
  const struct iovec part = {(void *)(uintptr_t)&task, sizeof task};
  assert_true(isolate_open(process, ctx));
  assert_int_equal(isolate_send(process, FRAME_TASK, &part, 1, -1), CHANNEL_OK);
}

/* Runs such a process, and takes its answer. */
static void run(orb_context *ctx, char what, said_text said) {
  isolated process;
  frame f;
  done_head done;
  start(ctx, what, &process);
  assert_int_equal(isolate_receive(&process, CHANNEL_ANSWER_MOST, &f), CHANNEL_OK);
  assert_int_equal(f.size, sizeof done);
  memcpy(&done, f.bytes, sizeof done);
  memcpy(said, done.detail, sizeof done.detail);
  frame_free(&f);
  isolate_close(&process);
}

/* The kernel gives a process twice its budget (64 MB here), and what a small one needs beside it. */
static void test_a_process_that_takes_all_memory(void **state) {
  said_text said;
  if (SANDBOX_SANITIZED) {
    skip(); /* no limit on memory */
  }
  run(*state, GREEDY, said);
  const int megabytes = atoi(said);
  print_message("%d MB\n", megabytes);
  assert_in_range(megabytes, 64, 2 * 64 + 80);
}

/* A process has one file in memory, with as many bytes as its budget (64 MB), also if its inputs are large. */
static void test_a_process_that_keeps_files(void **state) {
  said_text said;
  int megabytes, files, mapped;
  if (SANDBOX_SANITIZED) {
    skip(); /* no filter of system calls */
  }
  run(*state, FILES, said);
  print_message("%s\n", said);
  assert_int_equal(sscanf(said, "%d %d %d", &megabytes, &files, &mapped), 3);
  assert_int_equal(megabytes, 64);
  assert_int_equal(files, 0);
  assert_int_equal(mapped, 0);
}

/* What a process writes to standard error is part of a line of the log, and no line by itself. */
static void test_lines_that_look_like_those_of_the_log(void **state) {
  said_text said;
  static const char before[] = "{\"time\":\"", within[] = "\"wrote\":\"{\\\"audit\\\":\\\"delete\\\"";
  char text[65536];
  if (SANDBOX_SANITIZED) {
    skip(); /* reports of the sanitizers go to the log as they are */
  }
  const int log = memfd_create("log", MFD_CLOEXEC), kept = dup(STDERR_FILENO);
  assert_true(log >= 0 && kept >= 0);
  isolate_stop();
  dup2(log, STDERR_FILENO);
  log_setup(LOG_WARN, 1);
  const int starts = isolate_start(ISOLATE_ON);
  run(*state, FORGED, said);
  log_setup(LOG_ERROR, 0);
  dup2(kept, STDERR_FILENO);
  const ssize_t size = pread(log, text, sizeof text - 1, 0);
  close(kept);
  close(log);
  assert_true(starts && size > 0);
  text[size] = 0;
  assert_ptr_equal(strchr(text, '\n'), text + size - 1); /* a single line */
  assert_memory_equal(text, before, sizeof before - 1);
  assert_non_null(strstr(text, within));
  assert_non_null(strstr(text, "\xef\xbf\xbd\\u009b\\n{")); /* NUL does not end the text */
  assert_null(strstr(text, "\xc2\x9b"));
  assert_in_range(size, 1, 4096);
}

/* Signals that the kernel sends for a descriptor reach any process of the same user. */
static void test_a_process_that_sends_signals(void **state) {
  said_text said;
  if (SANDBOX_SANITIZED) {
    skip(); /* no filter of system calls */
  }
  run(*state, SIGNALS, said);
  assert_string_equal(said, "-1 -1 -1 -1 -1 -1");
}

/* No memory can be written to and run. */
static void test_a_process_that_brings_code(void **state) {
  said_text said;
  if (SANDBOX_SANITIZED) {
    skip(); /* no filter of system calls */
  }
  run(*state, CODE, said);
  assert_string_equal(said, "1 0 0");
}

/* The kernel ends a process whose time is used up, whatever the daemon does. */
static void test_a_process_that_spins(void **state) {
  isolated process;
  frame f = {0};
  start(*state, SPINS, &process);
  const channel_result got = isolate_receive(&process, CHANNEL_ANSWER_MOST, &f);
  const int status = isolate_close(&process);
  assert_int_equal(got, CHANNEL_CLOSED);
  assert_true(WIFSIGNALED(status));
  print_message("signal %d\n", WTERMSIG(status));
  assert_true(WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL);
}

int main(int count, char **arguments) {
  if (count > 1 && strcmp(arguments[1], ISOLATE_FLAG) == 0) {
    isolate_zygote(evil);
  }
  log_setup(LOG_ERROR, 0);
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_a_process_that_takes_all_memory),
      cmocka_unit_test(test_a_process_that_keeps_files),
      cmocka_unit_test(test_lines_that_look_like_those_of_the_log),
      cmocka_unit_test(test_a_process_that_sends_signals),
      cmocka_unit_test(test_a_process_that_brings_code),
      cmocka_unit_test(test_a_process_that_spins),
  };
  return sodium_init() < 0 ? 1 : cmocka_run_group_tests(tests, setup, teardown);
}
