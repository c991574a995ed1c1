#include "isolate/task.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "api/json.h"
#include "isolate/sandbox.h"

static int lacks; /* of SANDBOX_ALL, in this process */

static int refuse_unconfined(api_problem *problem) {
  return api_refuse(problem, "internal",
                    "The process for this work could not be confined, as isolate = strict demands, so it has read "
                    "nothing. Try again later; the daemon's log tells the operator why.");
}

int task_confine(int channel, const task_head *task) {
  const int results = task->kind == TASK_CHECK ? -1 : memfd_create("results", MFD_CLOEXEC);
  sandbox_limits limits = {.memory = task->limit + task->inputs,
                           .file = task->limit,
                           .cpu_seconds = task->cpu_seconds,
                           .threads = task->threads,
                           .nice = task->nice};
  lacks = SANDBOX_ALL & ~sandbox_enter(&limits);
  if (lacks && isolate_is_strict()) {
    api_problem problem = {0};
    refuse_unconfined(&problem);
    task_end(channel, &(done_head){0}, NULL, &problem);
  }
  return results;
}

channel_result task_send_object(int channel, int results, object_kind kind, const char *id, int64_t start,
                                int64_t size) {
  object_head head = {.kind = kind, .start = start, .size = size};
  strncpy(head.id, id, sizeof head.id - 1);
  const struct iovec part = {&head, sizeof head};
  return channel_send(channel, FRAME_OBJECT, &part, 1, results, NULL, NULL);
}

channel_result task_answer(int channel, done_head *done, const char *json, const api_problem *problem) {
  const char *text = done->fine ? json : problem && problem->name ? problem->facts.data : NULL;
  done->lacks = lacks;
  if (!done->fine && problem && problem->name) {
    snprintf(done->problem, sizeof done->problem, "%s", problem->name);
    snprintf(done->detail, sizeof done->detail, "%s", problem->detail);
  }
  const struct iovec parts[2] = {{done, sizeof *done}, {(void *)(uintptr_t)text, text ? strlen(text) : 0}};
  return channel_send(channel, FRAME_DONE, parts, 2, -1, NULL, NULL);
}

void task_end(int channel, done_head *done, const char *json, const api_problem *problem) {
  _exit(task_answer(channel, done, json, problem) == CHANNEL_OK ? 0 : 1);
}

/* A refusal names 32,768 loops of 262,144 vertices at most, a description as many that were closed, or 1,024 landmarks
 * on 16 shapes. No values are made of them here. */
enum { VALUES_MOST = 1 << 20 };

int task_is_object(const char *text) {
  return api_json_is_object(text, strlen(text), 0, VALUES_MOST);
}

int task_read_object(const frame *f, object_head *head) {
  if (f->size != sizeof *head || f->fd < 0) {
    return 0;
  }
  memcpy(head, f->bytes, sizeof *head);
  return head->start >= 0 && head->size >= 0 && (unsigned)head->kind < OBJECT_KINDS;
}

void task_free_object(const frame *f, const object_head *head) {
  if (head->size > 0) {
    (void)fallocate(f->fd, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, head->start, head->size);
  }
}

int task_read_done(const frame *f, done_head *done, char **json, api_problem *problem) {
  *json = NULL;
  if (f->size < sizeof *done) {
    return 0;
  }
  memcpy(done, f->bytes, sizeof *done);
  isolate_lacks(done->lacks);
  done->sha[sizeof done->sha - 1] = done->places[sizeof done->places - 1] = 0;
  done->problem[sizeof done->problem - 1] = done->detail[sizeof done->detail - 1] = 0;
  const char *text = (const char *)f->bytes + sizeof *done;
  int is_empty = f->size == sizeof *done;
  if (!done->fine) {
    if (!done->problem[0] || (!is_empty && !api_json_is_object(text, strlen(text), 1, VALUES_MOST))) {
      return 0;
    }
    api_refuse(problem, api_problem_name(done->problem), "%s", done->detail);
    if (!is_empty) {
      api_text_add(&problem->facts, text);
    }
    return 1;
  }
  if (!is_empty) {
    *json = strdup(text);
  }
  return is_empty || *json;
}

int task_refuse_open(const isolated *p, api_problem *problem) {
  return p->unconfined ? refuse_unconfined(problem)
                       : api_refuse(problem, "no-memory", "The server cannot start another process; try again later.");
}

int task_refuse_store(store_result result, api_problem *problem) {
  if (result == STORE_FULL) {
    return api_refuse(problem, "storage-full", "The server's disk is full; free some space and try again.");
  }
  return api_refuse(
      problem, "internal",
      "The store could not be read or written. Try again later; the daemon's log tells the operator why.");
}

int64_t task_cpu_seconds(int64_t deadline_ms, int threads) {
  int64_t left = deadline_ms - orb_clock_ms();
  return (left > 0 ? left / 1000 + 2 : 2) * (threads > 0 ? threads : 1);
}
