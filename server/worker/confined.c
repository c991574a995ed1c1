#include "worker/confined.h"

#include <malloc.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "convert.h"
#include "faults.h"
#include "intake.h"
#include "isolate/meter.h"
#include "isolate/task.h"
#include "worker/run.h"

enum { INPUTS_MOST = 2 * API_SHAPES_MAX + 2, PROGRESS_MS = 20, KEPT_BYTES = 16 << 20 };

typedef struct input {
  input_head head;
  char *json;
  int fd;
} input;

typedef struct confined {
  int channel, results, count;
  task_head task;
  char *request;
  input inputs[INPUTS_MOST];
  char stage[24];
  int64_t shown; /* orb_clock_ms() of the last progress sent */
} confined;

static store_result get(void *user, resource_kind kind, const char *id, resource *out) {
  const confined *c = user;
  for (int i = 0; i < c->count; i++) {
    if (c->inputs[i].head.row == kind && strcmp(c->inputs[i].head.id, id) == 0) {
      *out = (resource){.kind = kind, .json = strdup(c->inputs[i].json)};
      memcpy(out->id, c->inputs[i].head.id, sizeof out->id);
      memcpy(out->sha, c->inputs[i].head.sha, sizeof out->sha);
      return out->json ? STORE_OK : STORE_ERROR;
    }
  }
  return STORE_NOT_FOUND;
}

/* Two shapes of one mesh read it twice, so the descriptor stays here. */
static store_result read_object(void *user, object_kind kind, const char *id, int *fd, uint64_t *size) {
  const confined *c = user;
  for (int i = 0; i < c->count; i++) {
    const input *in = &c->inputs[i];
    if (in->fd >= 0 && in->head.object == kind && strcmp(in->head.id, id) == 0) {
      off_t end = lseek(in->fd, 0, SEEK_END);
      *fd = lseek(in->fd, 0, SEEK_SET) == 0 ? dup(in->fd) : -1;
      *size = (uint64_t)end;
      return *fd >= 0 && end >= 0 ? STORE_OK : STORE_ERROR;
    }
  }
  return STORE_NOT_FOUND;
}

static store_result publish(void *user, object_kind kind, const char *id, int64_t start, int64_t size) {
  const confined *c = user;
  return task_send_object(c->channel, c->results, kind, id, start, size) == CHANNEL_OK ? STORE_OK : STORE_ERROR;
}

static void show(void *user, const char *stage, double fraction) {
  confined *c = user;
  int64_t now = orb_clock_ms();
  if (strncmp(c->stage, stage, sizeof c->stage - 1) == 0 && now - c->shown < PROGRESS_MS) {
    return;
  }
  progress_head head = {.fraction = fraction};
  strncpy(head.stage, stage, sizeof head.stage - 1);
  memcpy(c->stage, head.stage, sizeof c->stage);
  c->shown = now;
  const struct iovec part = {&head, sizeof head};
  if (channel_send(c->channel, FRAME_PROGRESS, &part, 1, -1, NULL, NULL) != CHANNEL_OK) {
    _exit(1); /* the daemon has given this process up */
  }
}

static orb_context *make_context(confined *c, job_progress *progress) {
  orb_context_options options = {.memory_limit = (size_t)c->task.memory,
                                 .threads = c->task.threads,
                                 .deadline_ms = c->task.deadline_ms,
                                 .max_triangles = c->task.max_triangles,
                                 .meter = meter_set,
                                 .progress = progress_report,
                                 .progress_user = progress};
  orb_context *ctx = NULL;
  return orb_context_create(&options, &ctx) == ORB_OK ? ctx : NULL;
}

/* What a store lacks room for is memory here: the context has the error, as for all other memory. */
static void explain(const orb_context *ctx, api_problem *problem) {
  const orb_error *error = orb_context_error(ctx);
  if (problem->name && strcmp(problem->name, "storage-full") == 0 && error->status == ORB_E_NO_MEMORY) {
    api_problem_free(problem);
  }
  if (!problem->name) {
    api_problem_of_error(error, problem);
  }
}

static _Noreturn void run_job_task(confined *c) {
  job_progress progress = {.show = show, .user = c};
  run_env env = {.progress = &progress, .get = get, .user = c};
  const run_job task = {c->task.key, c->request, c->task.embed_ms};
  run_output out = {0};
  api_problem problem = {0};
  orb_context *ctx = make_context(c, &progress);
  const objects_remote remote = {publish, read_object, c, ctx, c->results, c->task.bucket};
  if (!ctx || objects_open_remote(&remote, &env.store) != STORE_OK) {
    _exit(1);
  }
  FAULT_POINT(c->task.key);
  int fine = c->task.kind == TASK_EMBEDDING ? run_embedding(&env, ctx, &task, &out, &problem)
                                            : run_supermesh(&env, ctx, &task, &out, &problem);
  if (!fine) {
    explain(ctx, &problem);
  }
  done_head done = {
      .fine = fine, .gone = out.gone, .flips = out.flips, .bytes = out.row.bytes, .created = out.row.created};
  memcpy(done.sha, out.row.sha, sizeof done.sha);
  memcpy(done.places, out.row.places, sizeof done.places);
  task_end(c->channel, &done, out.row.json, &problem);
}

/* The file follows the task, or is the frame's descriptor. */
static void check_one(confined *c, const frame *f) {
  const int is_sent = f->fd < 0;
  api_problem problem = {0};
  api_text json = {0};
  done_head done = {0};
  orb_context *ctx = make_context(c, NULL);
  if (!ctx || (is_sent && f->size - sizeof c->task != (uint64_t)c->task.bytes)) {
    _exit(1);
  }
  FAULT_POINT("check-begun");
  done.fine = intake_check_here(&c->task, is_sent ? f->bytes + sizeof c->task : NULL, f->fd, ctx, &json, &problem);
  if (!c->task.again) {
    task_end(c->channel, &done, json.data, &problem);
  }
  orb_context_destroy(ctx);
  if (task_answer(c->channel, &done, json.data, &problem) != CHANNEL_OK) {
    _exit(1);
  }
  api_text_free(&json);
  api_problem_free(&problem);
}

_Noreturn static void run_conversion(confined *c, const frame *f) {
  objects *store;
  api_problem problem = {0};
  done_head done = {0};
  orb_buffer out = {0};
  orb_context *ctx = make_context(c, NULL);
  const objects_remote remote = {publish, read_object, c, ctx, c->results, c->task.bucket};
  if (!ctx || objects_open_remote(&remote, &store) != STORE_OK) {
    _exit(1);
  }
  FAULT_POINT("convert-begun");
  done.fine = convert_here(&c->task, f->fd, ctx, &out, &problem);
  store_result sent = done.fine ? objects_put(store, OBJECT_ASSET, c->task.key, out.data, out.size) : STORE_OK;
  if (sent != STORE_OK) {
    done.fine = task_refuse_store(sent, &problem);
    explain(ctx, &problem);
  }
  done.bytes = (int64_t)out.size;
  task_end(c->channel, &done, NULL, &problem);
}

/* The daemon sent these frames, so what does not fit is a bug: the process ends. */
static void take_input(confined *c, frame *f) {
  input *in = &c->inputs[c->count++];
  if (c->count > INPUTS_MOST || f->size < sizeof in->head) {
    _exit(1);
  }
  memcpy(&in->head, f->bytes, sizeof in->head);
  in->fd = f->fd;
  f->fd = -1;
  in->json = strdup((const char *)f->bytes + sizeof in->head);
}

static void take_task(confined *c, frame *f) {
  channel_result got = channel_receive(c->channel, CHANNEL_MOST, f, NULL, NULL);
  if (got == CHANNEL_CLOSED) {
    _exit(0); /* the daemon no longer needs this process */
  }
  if (got != CHANNEL_OK || f->type != FRAME_TASK || f->size < sizeof c->task) {
    _exit(1);
  }
  memcpy(&c->task, f->bytes, sizeof c->task);
}

/* A process that checks several files keeps its heap: memory that it gave back between two files would be faulted in
 * again page by page. KEPT_BYTES: more than a file of READER_BYTES needs. */
_Noreturn static void run_checks(confined *c, frame *f) {
  if (c->task.again) {
    (void)mallopt(M_TRIM_THRESHOLD, KEPT_BYTES);
    (void)mallopt(M_MMAP_THRESHOLD, KEPT_BYTES);
  }
  for (;;) {
    check_one(c, f);
    frame_free(f);
    take_task(c, f);
    if (c->task.kind != TASK_CHECK) {
      _exit(1);
    }
  }
}

void confined_work(int channel) {
  confined c = {.channel = channel};
  frame f;
  take_task(&c, &f);
  c.results = task_confine(channel, &c.task);
  if (c.task.kind == TASK_CHECK) {
    run_checks(&c, &f);
  }
  if (c.task.kind == TASK_PROFILE) {
    run_conversion(&c, &f);
  }
  orb_keep_heap();
  c.request = strdup((const char *)f.bytes + sizeof c.task);
  frame_free(&f);
  while (channel_receive(channel, CHANNEL_MOST, &f, NULL, NULL) == CHANNEL_OK && f.type == FRAME_INPUT) {
    take_input(&c, &f);
    frame_free(&f);
  }
  if (f.type != FRAME_GO) {
    _exit(1);
  }
  frame_free(&f);
  run_job_task(&c);
}
