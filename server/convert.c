#include "convert.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

#include "log.h"
#include "store/crashes.h"

int convert_here(const task_head *task, int asset, orb_context *ctx, orb_buffer *out, api_problem *problem) {
  void *bytes = task->bytes > 0 ? mmap(NULL, (size_t)task->bytes, PROT_READ, MAP_PRIVATE, asset, 0) : MAP_FAILED;
  if (bytes == MAP_FAILED) {
    return api_refuse(problem, "no-memory", "The server has no memory left; try again later.");
  }
  orb_status status = orb_profile_write(ctx, bytes, (size_t)task->bytes, task->profile, NULL, out);
  munmap(bytes, (size_t)task->bytes);
  if (status != ORB_OK) {
    api_problem_of_error(orb_context_error(ctx), problem);
  }
  return status == ORB_OK;
}

/* Within the daemon, as isolate = off asks. */
static int convert_within(objects *store, const task_head *task, int asset, orb_context *ctx, object_temp *out,
                          api_problem *problem) {
  orb_buffer bytes = {0};
  int fine = convert_here(task, asset, ctx, &bytes, problem);
  store_result stored = fine ? objects_begin(store, out) : STORE_OK;
  if (fine && stored == STORE_OK) {
    stored = objects_append(out, bytes.data, bytes.size);
  }
  orb_buffer_free(ctx, &bytes);
  return stored == STORE_OK ? fine : task_refuse_store(stored, problem);
}

/* Takes the object and the end: 1, 0 with the problem, −1: the process died, was stopped, or sent something else
 * (*breach). */
static int take(isolated *p, objects *store, orb_context *ctx, object_temp *out, const char **breach,
                api_problem *problem) {
  frame f;
  done_head done;
  char *json = NULL;
  int64_t bytes = 0;
  channel_result got = isolate_receive(p, CHANNEL_ANSWER_MOST, &f);
  if (got == CHANNEL_OK && f.type == FRAME_OBJECT) {
    object_head head = {.size = 0};
    const int fits = task_read_object(&f, &head);
    store_result stored = fits ? objects_copy(store, ctx, f.fd, head.start, head.size, out) : STORE_OK;
    bytes = head.size;
    if (fits) {
      task_free_object(&f, &head);
    }
    frame_free(&f);
    *breach = fits ? NULL : "an object without its size or its file";
    if (!fits || stored != STORE_OK) {
      return fits && orb_context_check(ctx) == ORB_OK ? task_refuse_store(stored, problem) : -1;
    }
    got = isolate_receive(p, CHANNEL_ANSWER_MOST, &f);
  }
  if (got != CHANNEL_OK) {
    *breach = isolate_breach(p, got);
    return -1;
  }
  int fine = f.type == FRAME_DONE && task_read_done(&f, &done, &json, problem);
  frame_free(&f);
  free(json);
  if (fine && !done.fine) {
    return 0;
  }
  *breach = fine && bytes > 0 && done.bytes == bytes ? NULL : "an end that does not fit the conversion";
  return *breach ? -1 : 1;
}

/* The process died, or was ended for a breach. */
static int refuse_dead(catalogue *cat, const char *id, const char *tenant, const task_head *task, const char *breach,
                       int status, int alone, api_problem *problem) {
  char why[100];
  isolate_end_text(breach, status, why, sizeof why);
  log_error("the process that converted the asset of supermesh %s %s", id, why);
  if (isolate_end_counts(breach, status, alone)) {
    catalogue_crash_of(cat, task->key, id, tenant, (int64_t)time(NULL) * 1000);
  }
  return api_refuse(problem, "job-crashed",
                    "The process that converted the asset died. Please report this as a bug, with the meshes.");
}

static int convert_isolated(catalogue *cat, objects *store, orb_context *ctx, const char *id, const task_head *task,
                            int asset, const char *tenant, const convert_limits *limits, object_temp *out,
                            api_problem *problem) {
  isolated process;
  const char *breach = NULL;
  const struct iovec part = {(void *)(uintptr_t)task, sizeof *task};
  if (!isolate_open(&process, ctx)) {
    return task_refuse_open(&process, problem);
  }
  process.wanted = limits->wanted;
  process.user = limits->user;
  int result = -1;
  const channel_result sent = isolate_send(&process, FRAME_TASK, &part, 1, asset);
  if (sent == CHANNEL_OK) {
    result = take(&process, store, ctx, out, &breach, problem);
  } else {
    breach = isolate_breach(&process, sent);
  }
  const int alone = isolate_is_alone(&process);
  int status = isolate_close(&process);
  if (result >= 0) {
    return result;
  }
  if (orb_context_check(ctx) != ORB_OK) {
    api_problem_of_error(orb_context_error(ctx), problem);
    return 0;
  }
  return refuse_dead(cat, id, tenant, task, breach, status, alone, problem);
}

int convert_asset(catalogue *cat, objects *store, orb_context *ctx, const char *id, orb_profile profile, int asset,
                  int64_t size, const char *tenant, const convert_limits *limits, object_temp *out,
                  api_problem *problem) {
  task_head task = {.kind = TASK_PROFILE,
                    .threads = 1,
                    .limit = limits->memory,
                    .memory = limits->memory,
                    .inputs = size,
                    .deadline_ms = limits->deadline_ms,
                    .cpu_seconds = task_cpu_seconds(limits->deadline_ms, 1),
                    .bytes = size,
                    .profile = profile};
  char work[API_ID_SIZE + 32];
  int length = snprintf(work, sizeof work, "%s %s", orb_profile_name(profile), id);
  api_id_of_text(work, (size_t)length, task.key);
  *out = (object_temp){.fd = -1};
  if (catalogue_crashed(cat, task.key)) {
    return api_refuse(problem, "job-crashed",
                      "Three processes that converted this asset have died, so it is refused until the operator clears "
                      "it (orbmorphd crash clear). Please report this as a bug, with the meshes.");
  }
  int fine = isolate_is_on() ? convert_isolated(cat, store, ctx, id, &task, asset, tenant, limits, out, problem)
                             : convert_within(store, &task, asset, ctx, out, problem);
  if (!fine) {
    objects_abandon(out);
  }
  return fine;
}
