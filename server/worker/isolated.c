#include "worker/isolated.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "api/json.h"
#include "isolate/task.h"
#include "log.h"
#include "store/alignments.h"
#include "store/object_removal.h"
#include "store/verify.h"

enum { INPUTS_MOST = 2 * API_SHAPES_MAX + 3 };

typedef struct collected {
  resource_key keys[INPUTS_MOST];
  object_kind objects[INPUTS_MOST];
  resource rows[INPUTS_MOST]; /* without JSON: there is no such row */
  int fds[INPUTS_MOST], count;
  char alignment[API_ID_SIZE]; /* the id of the one that the job takes or keeps; "": none */
  int64_t bytes;
} collected;

/* Adds a row, once, and its object. */
static void want(collected *all, resource_kind kind, object_kind object, const char *id) {
  int at = all->count;
  for (int i = 0; i < at; i++) {
    if (all->keys[i].kind == kind && strcmp(all->keys[i].id, id) == 0) {
      return;
    }
  }
  if (at < INPUTS_MOST) {
    all->keys[at].kind = kind;
    snprintf(all->keys[at].id, sizeof all->keys[at].id, "%s", id);
    all->objects[at] = object;
    all->fds[at] = -1;
    all->count++;
  }
}

static void let_go(collected *all) {
  for (int i = 0; i < all->count; i++) {
    resource_free(&all->rows[i]);
    if (all->fds[i] >= 0) {
      close(all->fds[i]);
    }
  }
}

/* The result of the job comes first. Then the inputs that the request names: a request that does not decode has none,
 * and the process reports that. */
static void want_all(api_job_kind kind, const run_job *j, collected *all) {
  api_json_error error;
  api_problem ignored = {0};
  cJSON *body = api_json_parse(j->request, strlen(j->request), &error);
  api_supermesh_request merge;
  api_embedding_request one;
  memset(&merge, 0, sizeof merge);
  want(all, kind == API_JOB_EMBEDDING ? RESOURCE_EMBEDDING : RESOURCE_SUPERMESH, OBJECT_KINDS, j->key);
  if (body && kind == API_JOB_EMBEDDING && api_embedding_request_read(body, &one, &ignored)) {
    want(all, RESOURCE_MESH, OBJECT_MESH, one.mesh);
  } else if (body && kind == API_JOB_SUPERMESH && api_supermesh_request_read(body, &merge, &ignored)) {
    for (int32_t s = 0; s < merge.shape_count; s++) {
      api_embedding_request wanted = {.options = merge.embedding};
      char embedding[API_ID_SIZE];
      memcpy(wanted.mesh, merge.shapes[s].mesh, sizeof wanted.mesh);
      want(all, RESOURCE_MESH, OBJECT_MESH, wanted.mesh);
      if (api_embedding_request_id(&wanted, embedding)) {
        want(all, RESOURCE_EMBEDDING, OBJECT_SPHERE, embedding);
      }
    }
    if (merge.start[0]) {
      want(all, RESOURCE_ALIGNMENT, OBJECT_ALIGNMENT, merge.start);
    }
    if (api_alignment_id(&merge, all->alignment)) {
      want(all, RESOURCE_ALIGNMENT, OBJECT_ALIGNMENT, all->alignment);
    } else {
      all->alignment[0] = 0;
    }
  }
  api_supermesh_request_free(&merge);
  api_problem_free(&ignored);
  cJSON_Delete(body);
}

/* Opens the objects of the inputs that exist. */
static void open_all(const run_env *env, collected *all) {
  for (int i = 1; i < all->count; i++) {
    uint64_t size;
    if (!all->rows[i].json) {
      continue;
    }
    if (objects_read(env->store, all->objects[i], all->keys[i].id, &all->fds[i], &size) == STORE_OK) {
      all->bytes += (int64_t)size;
    }
    if (resource_is_derived(all->keys[i].kind)) {
      catalogue_touch(env->cat, all->keys[i].kind, all->keys[i].id);
    }
  }
}

static channel_result send_all(isolated *p, const task_head *task, const char *request, const collected *all) {
  const struct iovec begin[2] = {{(void *)(uintptr_t)task, sizeof *task},
                                 {(void *)(uintptr_t)request, strlen(request)}};
  channel_result result = isolate_send(p, FRAME_TASK, begin, 2, -1);
  for (int i = 1; i < all->count && result == CHANNEL_OK; i++) {
    const resource *row = &all->rows[i];
    input_head head = {.row = all->keys[i].kind, .object = all->objects[i]};
    memcpy(head.id, all->keys[i].id, sizeof head.id);
    memcpy(head.sha, row->sha, sizeof head.sha);
    if (!row->json) { /* the process reports what it lacks */
      continue;
    }
    const struct iovec parts[2] = {{&head, sizeof head}, {row->json, strlen(row->json)}};
    result = isolate_send(p, FRAME_INPUT, parts, 2, all->fds[i]);
  }
  return result == CHANNEL_OK ? isolate_send(p, FRAME_GO, NULL, 0, -1) : result;
}

/* Whether the process gets no row of an embedding that the job needs: it is gone, or could not be read. */
static int lacks_embedding(const collected *all) {
  int lacks = 0;
  for (int i = 1; i < all->count; i++) {
    lacks |= all->keys[i].kind == RESOURCE_EMBEDDING && !all->rows[i].json;
  }
  return lacks;
}

/* What a job of this kind may make. */
static int may_make(api_job_kind kind, object_kind object) {
  return kind == API_JOB_EMBEDDING ? object == OBJECT_SPHERE
                                   : object == OBJECT_ASSET || object == OBJECT_PLACES || object == OBJECT_SPHERES;
}

/* Keeps an alignment, whose row has the hash of its bytes. */
static void take_alignment(const run_env *env, orb_context *ctx, const char *id, const object_head *head,
                           const frame *f) {
  object_temp temp = {.fd = -1};
  const store_result stored = objects_copy(env->store, ctx, f->fd, head->start, head->size, &temp);
  task_free_object(f, head);
  if (stored != STORE_OK || alignments_publish(env->cat, env->store, id, env->tenant, &temp) != STORE_OK) {
    log_warn("the alignment %s could not be kept", id);
  }
  objects_abandon(&temp);
}

/* What a process may report: each report costs the daemon's time, and each new stage a write to the catalogue.
 * REPORTS_MOST: in a second. A process sends 50, as confined.c limits it, and its socket holds at most some 300 more,
 * which arrive at once if the daemon is late. STAGES_MOST: of a job. A supermesh has 6; an embedding has 6, and more if
 * several methods are tried. */
enum { REPORTS_MOST = 5000, STAGES_MOST = 64 };

typedef struct reports {
  int64_t since_ms; /* orb_clock_ms() at which the present second began */
  int count;        /* in this second */
  int stages;
  char stage[sizeof((progress_head *)0)->stage];
} reports;

/* The answers of a process to its job. */
typedef struct answers {
  const run_env *env;
  orb_context *ctx;
  api_job_kind kind;
  const run_job *job;
  const char *alignment;       /* as in collected */
  int64_t hold_ms;             /* for which the process may still let the daemon wait while it holds the store */
  int lacks;                   /* as lacks_embedding() */
  unsigned kinds;              /* of the objects that have come: a bit each */
  int64_t bytes[OBJECT_KINDS]; /* of each object that the process has made */
  reports so_far;
  channel_result got; /* the last result of the channel */
  const char *breach; /* what the process did against the protocol; NULL: nothing */
} answers;

static int breach(answers *a, const char *what) {
  a->breach = what;
  return -1;
}

/* Stores an object that the process has made: 1, 0 with the problem, −1: it may not make that. */
static int take_object(answers *a, const frame *f, run_output *out, api_problem *problem) {
  const run_env *env = a->env;
  object_head head;
  if (!task_read_object(f, &head)) {
    return breach(a, "an object without its size or its file");
  }
  if (a->kinds & 1u << head.kind) {
    return breach(a, "two objects of a kind");
  }
  a->kinds |= 1u << head.kind;
  if (head.kind == OBJECT_ALIGNMENT && a->kind == API_JOB_SUPERMESH) {
    if (!a->alignment[0] || memcmp(head.id, a->alignment, sizeof head.id) != 0 || out->holds) {
      return breach(a, "another alignment than that of the job");
    }
    take_alignment(env, a->ctx, a->alignment, &head, f);
    return 1;
  }
  if (!may_make(a->kind, head.kind) || memcmp(head.id, a->job->key, sizeof head.id) != 0) {
    return breach(a, "an object that the job does not make");
  }
  if (!out->holds) {
    objects_hold(env->store);
    out->holds = 1;
  }
  object_temp temp = {.fd = -1};
  store_result stored = objects_copy(env->store, a->ctx, f->fd, head.start, head.size, &temp);
  task_free_object(f, &head);
  a->bytes[head.kind] = head.size;
  stored = stored == STORE_OK ? objects_publish(env->store, &temp, head.kind, head.id) : stored;
  objects_abandon(&temp);
  if (stored != STORE_OK && orb_context_check(a->ctx) == ORB_OK) {
    task_refuse_store(stored, problem);
  }
  return stored == STORE_OK;
}

/* Whether a result has a description, and as many bytes as its objects, by which quotas count it. */
static int is_result(const done_head *done, const char *json, const int64_t bytes[OBJECT_KINDS]) {
  int64_t sum = 0;
  for (int kind = 0; kind < OBJECT_KINDS; kind++) {
    sum += bytes[kind];
  }
  return done->bytes == sum && json && task_is_object(json);
}

static int take_done(answers *a, const frame *f, run_output *out, api_problem *problem) {
  done_head done;
  char *json;
  if (!task_read_done(f, &done, &json, problem) || (done.fine && !is_result(&done, json, a->bytes))) {
    free(json);
    api_problem_free(problem);
    return breach(a, "an end that is neither a result nor a problem");
  }
  /* A job that lacks an embedding is planned again, and its attempt does not count: it must not repeat for ever. */
  if (done.gone && !a->lacks) {
    free(json);
    api_problem_free(problem);
    return breach(a, "the claim that an embedding is gone");
  }
  out->gone = done.gone;
  out->flips = done.flips;
  out->row.kind = a->kind == API_JOB_EMBEDDING ? RESOURCE_EMBEDDING : RESOURCE_SUPERMESH;
  out->row.bytes = done.bytes;
  out->row.created = done.created;
  out->row.json = json;
  memcpy(out->row.id, a->job->key, sizeof out->row.id);
  memcpy(out->row.sha, done.sha, sizeof done.sha);
  memcpy(out->row.places, done.places, sizeof done.places);
  return done.fine;
}

/* Whether a text is the name of a stage, as core and the jobs write them. */
static int is_stage(const char *text) {
  const size_t letters = strspn(text, "abcdefghijklmnopqrstuvwxyz");
  return letters > 0 && text[letters] == 0;
}

/* Shows a report of progress, but not once results arrive (holds): then stages no longer change. 1, or −1: no process
 * reports that, or so much. */
static int take_progress(answers *a, const frame *f, int holds) {
  reports *so_far = &a->so_far;
  const int64_t now = orb_clock_ms();
  progress_head head;
  if (now - so_far->since_ms >= 1000) {
    so_far->since_ms = now;
    so_far->count = 0;
  }
  if (++so_far->count > REPORTS_MOST) {
    return breach(a, "too many reports");
  }
  if (f->size != sizeof head) {
    return breach(a, "a report of another size");
  }
  memcpy(&head, f->bytes, sizeof head);
  head.stage[sizeof head.stage - 1] = 0;
  if (strcmp(head.stage, so_far->stage) != 0) {
    memcpy(so_far->stage, head.stage, sizeof so_far->stage);
    so_far->stages++;
  }
  if (so_far->stages > STAGES_MOST || !is_stage(head.stage)) {
    return breach(a, so_far->stages > STAGES_MOST ? "too many stages" : "a stage without a name");
  }
  if (!holds) {
    progress_report(a->env->progress, head.stage, head.fraction >= 0 && head.fraction <= 1 ? head.fraction : 0);
  }
  return 1;
}

/* Receives a frame. While the daemon holds the store, it waits no longer than hold_ms for all frames together. What it
 * does with them itself, as sending an object to a bucket, does not count. */
static channel_result receive(isolated *p, answers *a, int holds, frame *f) {
  const int64_t began = orb_clock_ms();
  p->last_ms = holds ? began + a->hold_ms : 0;
  const channel_result got = isolate_receive(p, CHANNEL_ANSWER_MOST, f);
  a->hold_ms -= holds ? orb_clock_ms() - began : 0;
  return got;
}

/* Takes frames until the end: as take_done(), or −1, also if the process died or was stopped. */
static int listen_to(isolated *p, answers *a, run_output *out, api_problem *problem) {
  frame f;
  for (int taken = 1;;) {
    a->got = receive(p, a, out->holds, &f);
    if (a->got == CHANNEL_STOPPED && orb_context_check(a->ctx) == ORB_OK) {
      return breach(a, "too late after an object");
    }
    if (a->got != CHANNEL_OK) {
      return breach(a, isolate_breach(p, a->got));
    }
    const int over = f.type == FRAME_DONE;
    if (f.type == FRAME_PROGRESS) {
      taken = take_progress(a, &f, out->holds);
    } else if (f.type == FRAME_OBJECT) {
      taken = take_object(a, &f, out, problem);
    } else {
      taken = over ? take_done(a, &f, out, problem) : breach(a, "a frame that only the service sends");
    }
    frame_free(&f);
    if (taken <= 0 || over) {
      return taken;
    }
  }
}

/* Gives back the hold that began with the first object, also if the process failed after that. Until then, no thread
 * can move an object to quarantine. */
static void let_go_of_made(const run_env *env, run_output *out) {
  if (out->holds) {
    objects_let_go(env->store);
    out->holds = 0;
  }
}

/* The process found an input that does not match its hash. Returns whether the job can be planned again: a damaged
 * embedding lost its row. */
static int quarantine_inputs(const run_env *env, const collected *all) {
  int gone = 0;
  for (int i = 1; i < all->count; i++) {
    resource row = {0};
    if (!all->rows[i].sha[0] || all->objects[i] == OBJECT_ALIGNMENT) { /* a wrong one is computed again */
      continue;
    }
    verify_again(env->store, all->objects[i], all->keys[i].id, all->rows[i].sha);
    objects_settle(env->store); /* the scrub may have moved it */
    gone |= all->objects[i] == OBJECT_SPHERE &&
            catalogue_get(env->cat, RESOURCE_EMBEDDING, all->keys[i].id, &row) == STORE_NOT_FOUND;
    resource_free(&row);
  }
  return gone;
}

int isolated_run(const run_env *env, orb_context *ctx, api_job_kind kind, const run_job *j,
                 const isolated_limits *limits, run_output *out, api_problem *problem, isolated_end *end) {
  isolated process;
  collected inputs = {.alignment = ""};
  *end = (isolated_end){.status = -1};
  want_all(kind, j, &inputs);
  catalogue_get_all(env->cat, inputs.keys, inputs.count,
                    inputs.rows);                  /* if they cannot be read, the process lacks them */
  const int is_made = inputs.rows[0].json != NULL; /* by an earlier attempt, or for another owner */
  if (is_made || !isolate_open(&process, ctx)) {
    let_go(&inputs);
    return is_made || task_refuse_open(&process, problem);
  }
  open_all(env, &inputs);
  task_head task = {.kind = kind == API_JOB_EMBEDDING ? TASK_EMBEDDING : TASK_SUPERMESH,
                    .threads = limits->threads,
                    .nice = limits->nice,
                    .bucket = objects_are_remote(env->store),
                    .limit = limits->memory,
                    .memory = limits->memory,
                    .inputs = inputs.bytes,
                    .deadline_ms = limits->deadline_ms,
                    .cpu_seconds = task_cpu_seconds(limits->deadline_ms, limits->threads),
                    .max_triangles = limits->max_triangles,
                    .embed_ms = j->embed_ms};
  memcpy(task.key, j->key, sizeof task.key);
  answers all = {.env = env,
                 .ctx = ctx,
                 .kind = kind,
                 .job = j,
                 .alignment = inputs.alignment,
                 .hold_ms = limits->hold_ms,
                 .lacks = lacks_embedding(&inputs)};
  all.got = send_all(&process, &task, j->request, &inputs);
  let_go(&inputs);
  /* A process that ends while it still gets inputs has sent its reason before. */
  const int may_answer = all.got == CHANNEL_OK || all.got == CHANNEL_CLOSED;
  int fine = may_answer ? listen_to(&process, &all, out, problem) : -1;
  int status = isolate_close(&process);
  if (fine == 0 && problem->name && strcmp(problem->name, "corrupt") == 0) {
    let_go_of_made(env, out);
    out->gone |= quarantine_inputs(env, &inputs);
  }
  if (fine >= 0 || (all.got == CHANNEL_STOPPED && !all.breach)) {
    return fine > 0; /* stopped: the context has the error */
  }
  end->died = 1;
  end->broke = all.breach != NULL;
  end->status = status;
  isolate_end_text(all.breach, status, end->why, sizeof end->why);
  return 0;
}
