#include "intake.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "faults.h"
#include "isolate/readers.h"
#include "log.h"
#include "store/crashes.h"
#include "store/object_removal.h"
#include "store/owners.h"

/* Bytes. A file of at most so many goes to its process in the frame: a copy costs less there than a descriptor, which
 * the daemon opens and the process maps, faults in and unmaps. The socket takes so much at once. */
enum { SENT_BYTES = 64 << 10 };

/* Reads a small file into memory, which takes less time than to map it, fault it in, and unmap it for all threads. */
static unsigned char *read_file(int fd, size_t size) {
  unsigned char *bytes = malloc(size + 1);
  size_t done = 0;
  while (bytes && done < size) {
    ssize_t n = pread(fd, bytes + done, size - done, (off_t)done);
    if (n > 0) {
      done += (size_t)n;
    } else if (n == 0 || errno != EINTR) {
      free(bytes);
      bytes = NULL;
    }
  }
  return bytes;
}

static unsigned char *map_file(int fd, size_t size) {
  void *at = mmap(NULL, size, PROT_READ, MAP_PRIVATE, fd, 0);
  return at == MAP_FAILED ? NULL : at;
}

int intake_open(intake_file *file, object_temp *temp, const api_hash *hash, int64_t size, const api_upload *upload) {
  api_hash whole = *hash;
  *file = (intake_file){.temp = temp, .size = size, .upload = upload};
  file->bytes = size <= SENT_BYTES ? read_file(temp->fd, (size_t)size) : map_file(temp->fd, (size_t)size);
  if (!file->bytes) {
    return 0;
  }
  orb_format found = orb_format_detect(file->bytes, (size_t)size);
  int forced = found == ORB_FORMAT_AUTO && upload->hint != ORB_FORMAT_AUTO;
  file->format = forced ? upload->hint : found;
  api_mesh_id(hash, upload->repair, forced ? orb_format_name(upload->hint) : NULL, file->id);
  api_hash_end(&whole, file->sha);
  return 1;
}

void intake_close(intake_file *file) {
  if (file->size <= SENT_BYTES) {
    free(file->bytes);
  } else if (file->bytes) {
    munmap(file->bytes, (size_t)file->size);
  }
  file->bytes = NULL;
}

/* Checks the mesh in these bytes. */
static int check(const task_head *task, const unsigned char *bytes, orb_context *ctx, api_text *json,
                 api_problem *problem) {
  orb_mesh mesh;
  api_mesh_facts facts = {.id = task->key,
                          .name = task->name,
                          .repair = task->repair,
                          .bytes = task->bytes,
                          .created = task->created,
                          .mesh = &mesh};
  memset(&mesh, 0, sizeof mesh);
  orb_format found = task->format;
  int fine = orb_mesh_read(ctx, bytes, (size_t)task->bytes, task->format, &mesh, &found) == ORB_OK &&
             orb_mesh_repair_with(ctx, &mesh, &task->options) == ORB_OK &&
             orb_mesh_topology(ctx, &mesh, &facts.topology) == ORB_OK;
  if (fine) {
    orb_mesh_extent(&mesh, &facts.extent);
    facts.format = orb_format_name(found);
    api_mesh_write(&facts, json);
    fine = !json->failed || api_refuse(problem, "no-memory", "The server has no memory left; try again later.");
  } else {
    api_problem_of_error(orb_context_error(ctx), problem);
    if (orb_context_error(ctx)->status == ORB_E_BAD_OPTION) { /* other options were checked when the request came */
      api_json_member_string(&problem->facts, "member", "part");
    }
  }
  orb_mesh_free(ctx, &mesh);
  return fine;
}

int intake_check_here(const task_head *task, const unsigned char *sent, int fd, orb_context *ctx, api_text *json,
                      api_problem *problem) {
  if (sent) {
    return check(task, sent, ctx, json, problem);
  }
  const void *bytes = mmap(NULL, (size_t)task->bytes, PROT_READ, MAP_PRIVATE, fd, 0);
  if (bytes == MAP_FAILED) {
    return api_refuse(problem, "no-memory", "The server has no memory left; try again later.");
  }
  int fine = check(task, bytes, ctx, json, problem);
  munmap((void *)(uintptr_t)bytes, (size_t)task->bytes);
  return fine;
}

/* Whether a description is valid JSON and agrees with what the daemon knows. Jobs of all owners read the mesh by it. */
static int is_of(const task_head *task, const char *text) {
  api_mesh_summary summary;
  return task_is_object(text) && api_mesh_summarise(text, &summary) && strcmp(summary.repair, task->repair) == 0 &&
         (task->format == ORB_FORMAT_AUTO || strcmp(summary.format, orb_format_name(task->format)) == 0);
}

/* What a process gets: the bytes, or a descriptor of the file. */
typedef struct given_file {
  const unsigned char *sent; /* NULL: the descriptor */
  int fd;
} given_file;

/* How a process ended that gave no answer. */
typedef struct check_end {
  int status;         /* as of isolate_close() */
  const char *breach; /* NULL: it died or was stopped */
  int alone;          /* no other process had work meanwhile */
} check_end;

/* 1 with the description, 0 with the problem, −1: the process died or was stopped, or broke the protocol. */
static int ask(isolated *process, const task_head *task, given_file file, api_text *json, const char **breach,
               api_problem *problem) {
  const struct iovec parts[2] = {{(void *)(uintptr_t)task, sizeof *task},
                                 {(void *)(uintptr_t)file.sent, file.sent ? (size_t)task->bytes : 0}};
  frame f;
  done_head done;
  char *text = NULL;
  *breach = NULL;
  channel_result got = isolate_send(process, FRAME_TASK, parts, 2, file.fd);
  got = got == CHANNEL_OK ? isolate_receive(process, CHANNEL_ANSWER_MOST, &f) : got;
  if (got != CHANNEL_OK) {
    *breach = isolate_breach(process, got);
    return -1;
  }
  int fine =
      f.type == FRAME_DONE && task_read_done(&f, &done, &text, problem) && (!done.fine || (text && is_of(task, text)));
  frame_free(&f);
  *breach = fine ? NULL : "an answer that does not fit the check";
  process->unconfined = fine && done.lacks && isolate_is_strict();
  if (fine && done.fine) {
    api_text_add(json, text);
    fine = !json->failed;
  }
  free(text);
  return fine ? done.fine : -1;
}

/* As ask(), in a process that may have read other files of the tenant (*others), or, without a tenant, in one of its
 * own. end: filled if the result is −1. */
static int ask_one(const task_head *task, given_file file, const char *tenant, orb_context *ctx,
                   const intake_limits *limits, api_text *json, api_problem *problem, int *others, check_end *end) {
  isolated own, *process = &own;
  task_head head = *task;
  reader *r = tenant ? reader_take(tenant, limits->part, task->bytes, task->memory, ctx) : NULL;
  *others = r && r->files > 0;
  if (r) {
    process = &r->process;
    head.again = 1;
    head.limit = r->memory;
    head.inputs = READER_BYTES;
    head.cpu_seconds += READER_WORK_MS / 1000;
  } else if (!isolate_open(&own, ctx)) {
    return task_refuse_open(&own, problem);
  }
  process->wanted = limits->wanted;
  process->user = limits->user;
  int result = ask(process, &head, file, json, &end->breach, problem);
  if (r && result >= 0 && !process->unconfined) {
    reader_give(r);
  } else {
    end->alone = isolate_is_alone(process);
    end->status = r ? reader_end(r) : isolate_close(&own);
  }
  return result;
}

/* 0: no descriptor. */
static int give_file(const intake_file *file, given_file *out) {
  char path[40];
  *out = (given_file){.sent = file->size <= SENT_BYTES ? file->bytes : NULL, .fd = -1};
  if (!out->sent) {
    snprintf(path, sizeof path, "/proc/self/fd/%d", file->temp->fd);
    out->fd = open(path, O_RDONLY | O_CLOEXEC);
  }
  return out->sent || out->fd >= 0;
}

/* Checks the mesh in a process that no other tenant uses. */
static int check_isolated(const intake_file *file, const task_head *task, const char *tenant, orb_context *ctx,
                          const intake_limits *limits, api_text *json, api_problem *problem, int *died) {
  char why[100];
  int others;
  check_end end = {.status = -1};
  given_file given;
  if (!give_file(file, &given)) {
    return api_refuse(problem, "no-memory", "The server cannot start another process; try again later.");
  }
  int result = ask_one(task, given, tenant, ctx, limits, json, problem, &others, &end);
  if (result < 0 && others && orb_context_check(ctx) == ORB_OK) {
    isolate_end_text(end.breach, end.status, why, sizeof why);
    log_warn("a process that checked several meshes, the last of them %s, %s; this one is checked again", file->id,
             why);
    result = ask_one(task, given, NULL, ctx, limits, json, problem, &others, &end);
  }
  if (given.fd >= 0) {
    close(given.fd);
  }
  if (result >= 0) {
    return result;
  }
  if (orb_context_check(ctx) != ORB_OK) {
    api_problem_of_error(orb_context_error(ctx), problem);
    return 0;
  }
  isolate_end_text(end.breach, end.status, why, sizeof why);
  *died = isolate_end_counts(end.breach, end.status, end.alone);
  log_error("the process that checked mesh %s %s", file->id, why);
  return api_refuse(problem, "job-crashed",
                    "The process that read the file died. Please report this as a bug, with the file.");
}

static int describe(const intake_file *file, catalogue *cat, const char *tenant, orb_context *ctx,
                    const intake_limits *limits, int64_t created, api_text *json, api_problem *problem, int *died) {
  task_head task = {.kind = TASK_CHECK,
                    .threads = 1,
                    .limit = limits->memory,
                    .memory = limits->memory,
                    .inputs = file->size,
                    .deadline_ms = limits->deadline_ms,
                    .cpu_seconds = task_cpu_seconds(limits->deadline_ms, 1),
                    .max_triangles = limits->max_triangles,
                    .options = file->upload->options,
                    .format = file->format,
                    .bytes = file->size,
                    .created = created};
  memcpy(task.key, file->id, sizeof task.key);
  memcpy(task.name, file->upload->name, sizeof task.name);
  memcpy(task.repair, file->upload->repair, sizeof task.repair);
  if (catalogue_crashed(cat, file->id)) {
    return api_refuse(problem, "job-crashed",
                      "Three processes that read this file have died, so it is refused until the operator clears "
                      "it (orbmorphd crash clear). Please report this as a bug, with the file.");
  }
  return isolate_is_on() ? check_isolated(file, &task, tenant, ctx, limits, json, problem, died)
                         : check(&task, file->bytes, ctx, json, problem);
}

/* Deletes an object that got no row. */
static void drop_unused(catalogue *cat, objects *store, const char *id) {
  resource row = {0};
  if (objects_exclude(store) && catalogue_get(cat, RESOURCE_MESH, id, &row) == STORE_NOT_FOUND) {
    objects_delete(store, OBJECT_MESH, id);
  }
  objects_let_go(store);
  resource_free(&row);
}

/* Publishes the object again if it is gone: it was published before the hold was lost. */
static store_result publish_again(objects *store, const intake_file *file) {
  objects_hold_again(store);
  store_result there = objects_look(store, OBJECT_MESH, file->id);
  if (there == STORE_NOT_FOUND) {
    there = objects_put(store, OBJECT_MESH, file->id, file->bytes, (size_t)file->size);
  }
  return there;
}

/* Commits the row of a published mesh. A hold is lost only while the database is unreachable, or its connections are
 * cut. */
static store_result put_row(const intake_file *file, catalogue *cat, objects *store, const resource *row,
                            const char *tenant, int64_t quota, int *fresh) {
  enum { LOST_TRIES = 3 };
  store_result stored = catalogue_put_for(cat, row, tenant, quota, fresh);
  for (int i = 0; stored == STORE_LOST && i < LOST_TRIES; i++) {
    stored = publish_again(store, file);
    stored = stored == STORE_OK ? catalogue_put_for(cat, row, tenant, quota, fresh) : stored;
  }
  return stored;
}

store_result intake_store(const intake_file *file, catalogue *cat, objects *store, orb_context *ctx,
                          const intake_limits *limits, const char *tenant, int64_t quota, intake_stored *out,
                          api_problem *problem) {
  api_text json = {0};
  resource row = {.kind = RESOURCE_MESH, .bytes = file->size, .created = (int64_t)time(NULL) * 1000};
  int died = 0, fresh = 0;
  *out = (intake_stored){0};
  if (!describe(file, cat, tenant, ctx, limits, row.created, &json, problem, &died)) {
    if (died) {
      catalogue_crash_of_mesh(cat, file->id, tenant, row.created);
    }
    api_text_free(&json);
    return STORE_OK;
  }
  memcpy(row.id, file->id, sizeof row.id);
  memcpy(row.sha, file->sha, sizeof row.sha);
  row.json = json.data;
  objects_hold(store);
  store_result stored = objects_publish(store, file->temp, OBJECT_MESH, file->id);
  FAULT_POINT("mesh-published");
  if (stored == STORE_OK) {
    stored = put_row(file, cat, store, &row, tenant, quota, &fresh);
  }
  objects_let_go(store);
  out->fresh = fresh != 0;
  if (fresh == PUT_FIRST) {
    out->row = row;
  } else {
    resource_free(&row);
  }
  if (stored == STORE_CONFLICT) {
    drop_unused(cat, store, file->id);
  }
  return stored;
}

/* Whether the stored object has the bytes of this file. */
static store_result compare(const intake_file *file, objects *store, int *same) {
  int fd;
  uint64_t size = 0;
  char sha[API_ID_SIZE] = "";
  store_result found = objects_read(store, OBJECT_MESH, file->id, &fd, &size);
  if (found != STORE_OK) {
    return found;
  }
  if (size == (uint64_t)file->size) {
    api_hash hash;
    unsigned char part[65536];
    ssize_t n;
    api_hash_begin(&hash);
    while ((n = read(fd, part, sizeof part)) > 0) {
      api_hash_add(&hash, part, (size_t)n);
    }
    api_hash_end(&hash, sha);
  }
  close(fd);
  *same = strcmp(sha, file->sha) == 0;
  return STORE_OK;
}

void intake_restore(const intake_file *file, objects *store) {
  int same = 0;
  store_result found = compare(file, store, &same);
  if (found == STORE_NOT_FOUND || (found == STORE_OK && !same)) {
    objects_hold(store);
    found = objects_publish(store, file->temp, OBJECT_MESH, file->id);
    objects_let_go(store);
    log_warn("the file of mesh %s was lost or altered and %s", file->id,
             found == STORE_OK ? "is restored" : "could not be restored");
  }
}
