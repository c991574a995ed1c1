/* What a job's process can do to the daemon if a mesh has taken it over. This program is its own zygote, whose
 * processes do what the request says. */
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmocka.h>
#include <sodium.h>

#include "api/json.h"
#include "isolate/task.h"
#include "log.h"
#include "store/owners.h"
#include "worker/isolated.h"

/* What the process does: the first four after an object. */
enum {
  DAMAGED = 'a',
  NOTHING = 'b',
  PROGRESS = 'c',
  OBJECTS = 'd',
  FEW_BYTES = 'f',
  LONG_REFUSAL = '1',
  MANY_VALUES = '2',
  LARGE_ALIGNMENT = '3',
  FLOOD = '4',
  STAGES = '5',
  STRANGE_STAGE = '6',
  KILLED = '7',
  GONE = '8',
  GONE_SPHERE = '9',
  SLOW = '0',
  HANGS_UP = 'h'
};

enum { LONG_BYTES = 48 << 20, VALUES = 6 << 20, ALIGNMENT_BYTES = 60 << 20, HOLD_MS = 300 };

typedef struct stored {
  char data[64];
  run_env env;
  orb_context *ctx;
  job_progress progress;
  int shown; /* how often progress was shown */
} stored;

static void count_shown(void *user, const char *stage, double fraction) {
  stored *s = user;
  (void)stage;
  (void)fraction;
  s->shown++;
}

static int setup(void **state) {
  stored *s = calloc(1, sizeof *s);
  strcpy(s->data, access("/dev/shm", W_OK) == 0 ? "/dev/shm/orbmorph-evil-XXXXXX" : "/tmp/orbmorph-evil-XXXXXX");
  if (!mkdtemp(s->data) || objects_open(s->data, &s->env.store) != STORE_OK ||
      catalogue_open(s->data, &s->env.cat) != STORE_OK || !isolate_start(ISOLATE_ON) ||
      orb_context_create(&(orb_context_options){.threads = 1}, &s->ctx) != ORB_OK) {
    return -1;
  }
  s->env.tenant = "";
  s->progress = (job_progress){.show = count_shown, .user = s};
  s->env.progress = &s->progress;
  *state = s;
  return 0;
}

static int teardown(void **state) {
  stored *s = *state;
  char command[128];
  isolate_stop();
  orb_context_destroy(s->ctx);
  catalogue_close(s->env.cat);
  objects_close(s->env.store);
  snprintf(command, sizeof command, "rm -rf %s", s->data);
  int failed = system(command);
  free(s);
  return failed;
}

/* ---- the process ---- */

static void send_kind(int channel, const task_head *task, object_kind kind) {
  object_head head = {.kind = kind, .size = 6};
  int fd = memfd_create("object", MFD_CLOEXEC);
  const struct iovec part = {&head, sizeof head};
  memcpy(head.id, task->key, sizeof head.id);
  if (fd < 0 || write(fd, "sphere", 6) != 6 ||
      channel_send(channel, FRAME_OBJECT, &part, 1, fd, NULL, NULL) != CHANNEL_OK) {
    _exit(9);
  }
  close(fd);
}

static void send_object(int channel, const task_head *task) {
  send_kind(channel, task, OBJECT_SPHERE);
}

static void send_progress(int channel, const char *stage) {
  progress_head head = {0};
  const struct iovec part = {&head, sizeof head};
  snprintf(head.stage, sizeof head.stage, "%s", stage);
  if (channel_send(channel, FRAME_PROGRESS, &part, 1, -1, NULL, NULL) != CHANNEL_OK) {
    _exit(9);
  }
}

/* A refusal with an array of zeros of so many bytes in all. */
_Noreturn static void refuse_at_length(int channel, size_t bytes) {
  done_head done = {.problem = "corrupt", .detail = "An input was altered."};
  char *text = malloc(bytes + 8);
  if (!text) {
    _exit(9);
  }
  size_t at = (size_t)sprintf(text, "\"a\":[");
  for (; at < bytes; at += 2) {
    memcpy(text + at, "0,", 2);
  }
  const struct iovec parts[2] = {{&done, sizeof done}, {text, at + (size_t)sprintf(text + at, "0]")}};
  _exit(channel_send(channel, FRAME_DONE, parts, 2, -1, NULL, NULL) == CHANNEL_OK ? 0 : 9);
}

_Noreturn static void send_large_alignment(int channel, const char *text) {
  object_head head = {.kind = OBJECT_ALIGNMENT, .size = ALIGNMENT_BYTES};
  const struct iovec part = {&head, sizeof head};
  api_json_error error;
  api_problem ignored = {0};
  api_supermesh_request request;
  memset(&request, 0, sizeof request);
  int fd = memfd_create("alignment", MFD_CLOEXEC);
  if (!api_supermesh_request_read(api_json_parse(text, strlen(text), &error), &request, &ignored) ||
      !api_alignment_id(&request, head.id) || ftruncate(fd, ALIGNMENT_BYTES) != 0 ||
      channel_send(channel, FRAME_OBJECT, &part, 1, fd, NULL, NULL) != CHANNEL_OK) {
    _exit(9);
  }
  _exit(0);
}

/* A result that says that it has no bytes, so that no quota counts it. */
_Noreturn static void claim_no_bytes(int channel, const task_head *task) {
  done_head done = {.fine = 1};
  send_object(channel, task);
  task_end(channel, &done, "{}", NULL);
}

/* A result whose objects come so that each pause is within the limit on the hold, but not all together. */
_Noreturn static void send_slowly(int channel, const task_head *task) {
  static const object_kind kinds[] = {OBJECT_ASSET, OBJECT_PLACES, OBJECT_SPHERES};
  done_head done = {.fine = 1, .bytes = 18};
  for (int i = 0; i < 3; i++) {
    send_kind(channel, task, kinds[i]);
    usleep(1000 * HOLD_MS * 2 / 3);
  }
  task_end(channel, &done, "{}", NULL);
}

/* Says that an embedding that the job needs has been deleted. */
_Noreturn static void say_gone(int channel) {
  done_head done = {.gone = 1};
  api_problem problem = {0};
  api_refuse(&problem, "not-found", "An embedding is gone.");
  task_end(channel, &done, NULL, &problem);
}

/* Reports progress for ever. */
_Noreturn static void report(int channel, const char *const stages[2], int pause_us) {
  for (int i = 0;; i++) {
    send_progress(channel, stages[i % 2]);
    if (pause_us > 0) {
      usleep((useconds_t)pause_us);
    }
  }
}

static void report_in_ways(int channel, char what) {
  switch (what) {
    case FLOOD:
      report(channel, (const char *const[]){"embed", "embed"}, 0);
    case STAGES:
      report(channel, (const char *const[]){"read", "embed"}, 5000);
    case STRANGE_STAGE:
      report(channel, (const char *const[]){"embed", "\",\xff"}, 5000);
    default:
      break;
  }
}

static void evil(int channel) {
  frame f;
  task_head task;
  char request[512] = "";
  if (channel_receive(channel, CHANNEL_MOST, &f, NULL, NULL) != CHANNEL_OK || f.size < sizeof task) {
    _exit(9);
  }
  memcpy(&task, f.bytes, sizeof task);
  snprintf(request, sizeof request, "%s", (const char *)f.bytes + sizeof task);
  do {
    frame_free(&f);
  } while (channel_receive(channel, CHANNEL_MOST, &f, NULL, NULL) == CHANNEL_OK && f.type != FRAME_GO);
  if (task.key[0] == DAMAGED) {
    api_problem problem = {0};
    done_head done = {0};
    send_object(channel, &task);
    api_refuse(&problem, "corrupt", "An input was altered.");
    task_end(channel, &done, NULL, &problem);
  }
  switch (task.key[0]) {
    case FEW_BYTES:
      claim_no_bytes(channel, &task);
    case LONG_REFUSAL:
      refuse_at_length(channel, LONG_BYTES);
    case MANY_VALUES:
      refuse_at_length(channel, 2 * VALUES);
    case LARGE_ALIGNMENT:
      send_large_alignment(channel, request);
    case GONE:
    case GONE_SPHERE:
      say_gone(channel);
    case SLOW:
      send_slowly(channel, &task);
    case KILLED:
      raise(SIGKILL);
      break;
    case HANGS_UP:
      close(channel);
      pause();
      break;
    default:
      break;
  }
  report_in_ways(channel, task.key[0]);
  for (int sent = 0;; sent++) {
    if (task.key[0] == OBJECTS || sent == 0) {
      send_object(channel, &task);
    }
    if (task.key[0] == PROGRESS) {
      send_progress(channel, "store");
    }
    usleep(task.key[0] == NOTHING ? 1000000 : 1000);
  }
}

/* ---- the daemon ---- */

static void fill_id(char id[API_ID_SIZE], char letter) {
  memset(id, letter, API_ID_SIZE - 1);
  id[API_ID_SIZE - 1] = 0;
}

/* A mesh whose file differs from its row. */
static void add_damaged_mesh(stored *s, const char *id) {
  char json[] = "{}";
  int fresh;
  resource row = {.kind = RESOURCE_MESH, .json = json, .bytes = 5, .created = 1};
  memcpy(row.id, id, sizeof row.id);
  fill_id(row.sha, '0');
  assert_int_equal(objects_put(s->env.store, OBJECT_MESH, id, "wrong", 5), STORE_OK);
  assert_int_equal(catalogue_put_for(s->env.cat, &row, "", 0, &fresh), STORE_OK);
}

/* Runs a job in a process that does this. Afterwards nothing holds the store. */
static int run_for(stored *s, char what, run_output *out, api_problem *problem, isolated_end *end) {
  char key[API_ID_SIZE], mesh[API_ID_SIZE], request[512];
  const int merges = what == LARGE_ALIGNMENT || what == GONE || what == GONE_SPHERE || what == SLOW;
  fill_id(key, what);
  fill_id(mesh, 'e');
  snprintf(request, sizeof request,
           merges ? "{\"shapes\":[{\"mesh\":\"%s\",\"name\":\"a\"},{\"mesh\":\"%s\",\"name\":\"b\"}],"
                    "\"align\":{\"method\":\"rotate\"}}"
                  : "{\"mesh\":\"%s\"}",
           mesh, mesh);
  const run_job j = {.key = key, .request = request};
  const isolated_limits limits = {.memory = 64 << 20, .threads = 1, .max_triangles = 1000, .hold_ms = HOLD_MS};
  *out = (run_output){0};
  int fine =
      isolated_run(&s->env, s->ctx, merges ? API_JOB_SUPERMESH : API_JOB_EMBEDDING, &j, &limits, out, problem, end);
  if (out->holds) {
    objects_let_go(s->env.store);
  }
  assert_true(objects_exclude(s->env.store));
  objects_let_go(s->env.store);
  resource_free(&out->row);
  return fine;
}

static int run(stored *s, char what, api_problem *problem, isolated_end *end) {
  run_output out;
  return run_for(s, what, &out, problem, end);
}

/* To move the input to quarantine, the daemon waits for everyone who holds the store: the job must not be one of them.
 */
static void test_an_object_and_then_a_damaged_input(void **state) {
  stored *s = *state;
  api_problem problem = {0};
  isolated_end end;
  char mesh[API_ID_SIZE];
  fill_id(mesh, 'e');
  add_damaged_mesh(s, mesh);
  assert_false(run(s, DAMAGED, &problem, &end));
  assert_string_equal(problem.name, "corrupt");
  assert_false(end.died);
  assert_int_equal(objects_look(s->env.store, OBJECT_MESH, mesh), STORE_NOT_FOUND);
  api_problem_free(&problem);
}

/* After its first object the process neither ends nor dies. The context has no deadline: only the limit on the hold
 * ends it. */
static void test_an_object_and_then_no_end(void **state) {
  static const char ways[] = {NOTHING, PROGRESS};
  for (size_t i = 0; i < sizeof ways; i++) {
    api_problem problem = {0};
    isolated_end end;
    assert_false(run(*state, ways[i], &problem, &end));
    assert_true(end.died && end.broke);
    assert_non_null(strstr(end.why, "broke the protocol: "));
    assert_null(problem.name);
  }
}

static void test_objects_that_hold_the_store(void **state) {
  static const char ways[] = {OBJECTS, SLOW};
  static const char *const why[] = {"two objects of a kind", "too late after an object"};
  for (size_t i = 0; i < sizeof ways; i++) {
    api_problem problem = {0};
    isolated_end end;
    assert_false(run(*state, ways[i], &problem, &end));
    assert_true(end.died && end.broke);
    assert_non_null(strstr(end.why, why[i]));
  }
}

/* The process reports progress for ever: without a pause, or in stages that no job has so many of, or one that no job
 * has. The context has no deadline: only the limits on reports end it. */
static void test_reports_without_end(void **state) {
  static const char ways[] = {FLOOD, STAGES, STRANGE_STAGE};
  static const int most[] = {5000, 64, 1}; /* reports that are shown */
  static const char *const why[] = {"too many reports", "too many stages", "a stage without a name"};
  for (size_t i = 0; i < sizeof ways; i++) {
    stored *s = *state;
    api_problem problem = {0};
    isolated_end end;
    s->shown = 0;
    assert_false(run(s, ways[i], &problem, &end));
    assert_true(end.died && end.broke);
    assert_in_range(s->shown, 1, most[i]);
    assert_non_null(strstr(end.why, why[i]));
  }
}

/* All that is received has arrived before, so the daemon never waits for the process. The context is asked even so. */
static void test_a_stop_while_bytes_arrive(void **state) {
  enum { FRAMES = 3 * CHANNEL_UNASKED / 2 };
  const stored *s = *state;
  int ends[2], taken = 0;
  frame f;
  assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends), 0);
  isolated p = {.channel = ends[0], .ctx = s->ctx};
  for (int i = 0; i < FRAMES; i++) {
    send_progress(ends[1], "embed");
  }
  channel_result got;
  orb_context_cancel(s->ctx);
  while ((got = isolate_receive(&p, CHANNEL_ANSWER_MOST, &f)) == CHANNEL_OK) {
    frame_free(&f);
    assert_true(++taken < FRAMES);
  }
  assert_int_equal(got, CHANNEL_STOPPED);
  close(ends[0]);
  close(ends[1]);
}

/* The deadline passes while the daemon stores an object: the end that the process has sent by then counts. */
static void test_an_end_that_arrived_in_time(void **state) {
  int ends[2];
  frame f;
  orb_context *ctx;
  done_head done = {.fine = 1};
  (void)state;
  assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends), 0);
  assert_int_equal(orb_context_create(&(orb_context_options){.threads = 1, .deadline_ms = 1}, &ctx), ORB_OK);
  isolated p = {.channel = ends[0], .ctx = ctx};
  assert_int_equal(task_answer(ends[1], &done, "{}", NULL), CHANNEL_OK);
  assert_int_equal(isolate_receive(&p, CHANNEL_ANSWER_MOST, &f), CHANNEL_OK);
  assert_int_equal(f.type, FRAME_DONE);
  frame_free(&f);
  assert_int_equal(isolate_receive(&p, CHANNEL_ANSWER_MOST, &f), CHANNEL_STOPPED);
  orb_context_destroy(ctx);
  close(ends[0]);
  close(ends[1]);
}

static long peak_kilobytes(void) {
  struct rusage used;
  assert_int_equal(getrusage(RUSAGE_SELF, &used), 0);
  return used.ru_maxrss;
}

/* The daemon takes no more memory, whatever a process says. */
static void test_answers_that_cost_memory(void **state) {
  static const char ways[] = {LARGE_ALIGNMENT, LONG_REFUSAL, MANY_VALUES};
  static const long most[] = {16, 16, 64}; /* megabytes */
  for (size_t i = 0; i < sizeof ways; i++) {
    stored *s = *state;
    api_problem problem = {0};
    isolated_end end;
    const long before = peak_kilobytes();
    assert_false(run(s, ways[i], &problem, &end));
    const long more = (peak_kilobytes() - before) / 1024;
    if (more > most[i] || !end.died) {
      fail_msg("way %c: %ld MB, died %d", ways[i], more, end.died);
    }
    assert_null(problem.name);
  }
}

static void test_a_result_that_says_it_has_no_bytes(void **state) {
  api_problem problem = {0};
  isolated_end end;
  assert_false(run(*state, FEW_BYTES, &problem, &end));
  assert_true(end.died && end.broke);
}

/* The embedding of the mesh, whose key is that of a request with default options. */
static void add_embedding(stored *s) {
  char json[] = "{}";
  int fresh;
  api_embedding_request request = {0};
  resource row = {.kind = RESOURCE_EMBEDDING, .json = json, .bytes = 1, .created = 1};
  api_json_error error;
  api_problem ignored = {0};
  char text[API_ID_SIZE + 16], mesh[API_ID_SIZE];
  fill_id(mesh, 'e');
  snprintf(text, sizeof text, "{\"mesh\":\"%s\"}", mesh);
  cJSON *body = api_json_parse(text, strlen(text), &error);
  assert_true(api_embedding_request_read(body, &request, &ignored) && api_embedding_request_id(&request, row.id));
  cJSON_Delete(body);
  assert_int_equal(catalogue_put_for(s->env.cat, &row, "", 0, &fresh), STORE_OK);
}

/* A job that lacks an embedding is queued again without a count. So the daemon believes that only of an embedding whose
 * row it has not found itself. */
static void test_an_embedding_that_is_said_to_be_gone(void **state) {
  api_problem problem = {0};
  isolated_end end;
  run_output out;
  assert_false(run_for(*state, GONE, &out, &problem, &end));
  assert_true(!end.died && out.gone);
  api_problem_free(&problem);
  add_embedding(*state);
  assert_false(run_for(*state, GONE_SPHERE, &out, &problem, &end));
  assert_true(end.died && end.broke && !out.gone);
  assert_null(problem.name);
}

/* Memory may be short, or the process has a fault: it has not broken the protocol. */
static void test_a_process_that_is_killed(void **state) {
  api_problem problem = {0};
  isolated_end end;
  assert_false(run(*state, KILLED, &problem, &end));
  assert_true(end.died && !end.broke);
  assert_string_equal(end.why, "was killed by signal 9 (Killed)");
}

/* It is not said to have ended, as if memory were short, so that others would wait while it runs alone. */
static void test_a_process_that_hangs_up(void **state) {
  api_problem problem = {0};
  isolated_end end;
  assert_false(run(*state, HANGS_UP, &problem, &end));
  assert_true(end.died && end.broke);
  assert_string_equal(end.why, "broke the protocol: it closed its channel and went on");
}

int main(int count, char **arguments) {
  if (count > 1 && strcmp(arguments[1], ISOLATE_FLAG) == 0) {
    isolate_zygote(evil);
  }
  log_setup(LOG_ERROR, 0);
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(test_an_object_and_then_a_damaged_input, setup, teardown),
      cmocka_unit_test_setup_teardown(test_an_object_and_then_no_end, setup, teardown),
      cmocka_unit_test_setup_teardown(test_objects_that_hold_the_store, setup, teardown),
      cmocka_unit_test_setup_teardown(test_reports_without_end, setup, teardown),
      cmocka_unit_test_setup_teardown(test_a_stop_while_bytes_arrive, setup, teardown),
      cmocka_unit_test(test_an_end_that_arrived_in_time),
      cmocka_unit_test_setup_teardown(test_answers_that_cost_memory, setup, teardown),
      cmocka_unit_test_setup_teardown(test_a_result_that_says_it_has_no_bytes, setup, teardown),
      cmocka_unit_test_setup_teardown(test_an_embedding_that_is_said_to_be_gone, setup, teardown),
      cmocka_unit_test_setup_teardown(test_a_process_that_is_killed, setup, teardown),
      cmocka_unit_test_setup_teardown(test_a_process_that_hangs_up, setup, teardown),
  };
  return sodium_init() < 0 ? 1 : cmocka_run_group_tests(tests, NULL, NULL);
}
