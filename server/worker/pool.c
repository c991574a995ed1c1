#include "worker/pool.h"

#include <pthread.h>
#include <semaphore.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include "api/json.h"
#include "faults.h"
#include "isolate/isolate.h"
#include "isolate/meter.h"
#include "log.h"
#include "metrics.h"
#include "store/keys.h"
#include "store/owners.h"
#include "worker/isolated.h"
#include "worker/spans.h"

/* PROBLEM_LOOPS: bytes of loops in the problem of a job, which stays in memory and in the catalogue as long as the job.
 */
enum { FETCHERS = 8, PROBLEM_LOOPS = 32 << 10 };

typedef struct worker {
  worker_pool *pool;
  pthread_t thread;
  queue_lane lane;
  int started;
} worker;

struct worker_pool {
  worker_options options;
  run_env env;
  sem_t checks; /* see fetch_options */
  int count;
  worker workers[];
};

/* The embeddings that a supermesh lacks, each once: keys, requests and triangles. */
typedef struct missing {
  char keys[API_SHAPES_MAX][API_ID_SIZE];
  api_text texts[API_SHAPES_MAX];
  int64_t costs[API_SHAPES_MAX];
  int count;
} missing;

static int64_t triangles_of(const run_env *env, const char *mesh) {
  resource row = {0};
  api_mesh_summary summary = {0};
  int64_t triangles = 0;
  if (catalogue_get(env->cat, RESOURCE_MESH, mesh, &row) == STORE_OK) {
    triangles = api_mesh_summarise(row.json, &summary) ? summary.triangles : 0;
    resource_free(&row);
  }
  return triangles;
}

/* The embeddings that the shapes need, each once. 0: out of memory. */
static int need_all(const api_supermesh_request *request, missing *list, char (*meshes)[API_ID_SIZE]) {
  for (int32_t s = 0; s < request->shape_count; s++) {
    api_embedding_request wanted = {.options = request->embedding};
    char *key = list->keys[list->count];
    int k = 0;
    memcpy(wanted.mesh, request->shapes[s].mesh, sizeof wanted.mesh);
    if (!api_embedding_request_id(&wanted, key)) {
      return 0;
    }
    while (k < list->count && strcmp(list->keys[k], key) != 0) {
      k++;
    }
    if (k == list->count) {
      memcpy(meshes[k], wanted.mesh, sizeof wanted.mesh);
      list->count++;
    }
  }
  return 1;
}

/* Leaves those that are missing. An embedding that only others own is requested for this owner too; its job finds the
 * result and ends at once. 0: the store failed, or out of memory. */
static int keep_missing(const run_env *env, const job *j, const api_supermesh_request *request, missing *list) {
  char meshes[API_SHAPES_MAX][API_ID_SIZE];
  int owns[API_SHAPES_MAX], kept = 0, fine = 1;
  if (!need_all(request, list, meshes) ||
      catalogue_owns(env->cat, RESOURCE_EMBEDDING, list->keys, list->count, job_owner(j), owns) != STORE_OK) {
    list->count = 0;
    return 0;
  }
  for (int k = 0; k < list->count; k++) {
    if (owns[k]) {
      continue;
    }
    api_embedding_request wanted = {.options = request->embedding};
    memcpy(wanted.mesh, meshes[k], sizeof wanted.mesh);
    memmove(list->keys[kept], list->keys[k], sizeof list->keys[k]);
    list->costs[kept] = triangles_of(env, meshes[k]);
    api_text *text = &list->texts[kept++];
    api_embedding_request_write(&wanted, text);
    fine &= !text->failed;
  }
  list->count = kept;
  return fine;
}

/* Makes a supermesh wait for the embeddings that it lacks. 1: it now waits; 0: it lacks none; −1: the store failed or
 * out of memory, retry later. */
static int plan(const run_env *env, job *j) {
  const char *requests[API_SHAPES_MAX];
  missing list = {.count = 0};
  int result = 0;
  api_problem problem = {0};
  api_supermesh_request request;
  api_json_error error;
  memset(&request, 0, sizeof request);
  cJSON *body = api_json_parse(job_request(j), strlen(job_request(j)), &error);
  if (body && api_supermesh_request_read(body, &request, &problem)) { /* else run_supermesh() reports the error */
    result = keep_missing(env, j, &request, &list) ? 0 : -1;
  }
  for (int i = 0; i < list.count; i++) {
    requests[i] = list.texts[i].data;
  }
  if (result == 0 && list.count > 0) {
    result = 1;
    if (queue_wait_for(env->q, j, list.keys, requests, list.costs, list.count) != QUEUE_OK) {
      log_warn("the embeddings that a job needs could not be queued; the job is retried");
    }
  }
  for (int i = 0; i < list.count; i++) {
    api_text_free(&list.texts[i]);
  }
  api_supermesh_request_free(&request);
  api_problem_free(&problem);
  cJSON_Delete(body);
  return result;
}

/* Ends a job whose run failed. */
static void finish_failed(const run_env *env, job *j, orb_context *ctx, api_problem *problem) {
  if (!problem->name) {
    const orb_error *error = orb_context_error(ctx);
    if (error->status == ORB_E_CANCELLED) {
      if (queue_cancel_wanted(env->q, j)) {
        queue_finish(env->q, j, API_JOB_CANCELLED, NULL);
      } else {
        queue_give_back(env->q, j); /* the service is stopping */
      }
      return;
    }
    api_problem_of_error(error, problem);
  }
  api_text text = {0};
  api_problem_shorten(problem, PROBLEM_LOOPS);
  api_problem_write(problem, &text);
  queue_finish(env->q, j, API_JOB_FAILED, text.failed ? NULL : text.data);
  api_text_free(&text);
}

/* The context of a job; NULL after ending the job. */
static orb_context *begin(worker_pool *pool, job *j, int threads, job_progress *progress) {
  const int64_t memory = queue_memory_of(pool->env.q, j);
  orb_context_options options = {.memory_limit = (size_t)(memory ? memory : pool->options.job_memory),
                                 .threads = threads,
                                 .deadline_ms = orb_clock_ms() + pool->options.job_ms,
                                 .max_triangles = pool->options.max_triangles,
                                 .meter = meter_set,
                                 .progress = progress_report,
                                 .progress_user = progress};
  orb_context *ctx = NULL;
  api_problem problem = {0};
  if (orb_context_create(&options, &ctx) != ORB_OK) {
    api_refuse(&problem, "no-memory", "The server has no memory left; try again later.");
    finish_failed(&pool->env, j, NULL, &problem);
    api_problem_free(&problem);
    return NULL;
  }
  queue_set_context(pool->env.q, j, ctx);
  return ctx;
}

static void report(const job *j, int fine, double seconds) {
  char fields[128];
  metrics_job((int)job_kind(j), fine, seconds);
  snprintf(fields, sizeof fields, "\"job\":\"%s\",\"seconds\":%.3f", job_id(j), seconds);
  log_write(LOG_INFO, fields, "%s job %s", api_job_kind_name(job_kind(j)), fine ? "done" : "did not succeed");
}

/* The result of a failed run in one word, for its span. */
static const char *why_failed(orb_context *ctx, const api_problem *problem) {
  const orb_status status = orb_context_error(ctx)->status;
  return problem->name ? problem->name : status != ORB_OK ? orb_status_name(status) : "given back";
}

/* Whether a job that ran since `began` may have failed because a store was unreachable. */
static int may_be_store(const run_env *env, int64_t began) {
  return objects_were_away(env->store, began) || catalogue_was_away(env->cat, began);
}

static void fetch_one(worker_pool *pool, job *j, job_spans *spans) {
  job_progress progress = {.q = pool->env.q, .j = j};
  run_env env = pool->env;
  char mesh[API_ID_SIZE];
  int claimed;
  api_problem problem = {0};
  int64_t began = orb_clock_ms();
  env.progress = &progress;
  queue_show_running(env.q, j);
  spans_run(spans, env.q, j, &progress);
  orb_context *ctx = begin(pool, j, 1, &progress);
  if (!ctx) {
    return;
  }
  int fine = run_fetch(&env, &pool->options.fetch, ctx, j, mesh, &claimed, &problem);
  queue_set_context(env.q, j, NULL);
  progress_enter(&progress, "");
  report(j, fine, 1e-3 * (double)(orb_clock_ms() - began));
  spans_end(spans, fine ? NULL : why_failed(ctx, &problem));
  if (!claimed) {
    queue_put_off(env.q, j);
  } else if (fine) {
    queue_finish_mesh(env.q, j, mesh);
  } else if (may_be_store(&env, began) && !queue_cancel_wanted(env.q, j)) {
    queue_give_back(env.q, j);
  } else {
    finish_failed(&env, j, ctx, &problem);
  }
  api_problem_free(&problem);
  orb_context_destroy(ctx);
}

/* Runs the job in a process of its own, or within this one. */
static int run_somewhere(worker_pool *pool, const run_env *env, orb_context *ctx, job *j, int threads, run_output *out,
                         api_problem *problem, isolated_end *end) {
  const run_job task = {job_key(j), job_request(j), queue_embed_ms(env->q, j)};
  if (isolate_is_on()) {
    const int64_t memory = queue_memory_of(env->q, j);
    const isolated_limits limits = {.memory = memory ? memory : pool->options.job_memory,
                                    .deadline_ms = orb_clock_ms() + pool->options.job_ms,
                                    .max_triangles = pool->options.max_triangles,
                                    .threads = threads,
                                    .nice = pool->options.nice,
                                    .hold_ms = ISOLATED_HOLD_MS};
    return isolated_run(env, ctx, job_kind(j), &task, &limits, out, problem, end);
  }
  FAULT_POINT(job_key(j));
  return job_kind(j) == API_JOB_EMBEDDING ? run_embedding(env, ctx, &task, out, problem)
                                          : run_supermesh(env, ctx, &task, out, problem);
}

/* The process of the job died. The kernel sends SIGKILL where memory is short, which another job may have caused: such
 * a job runs alone next time, and its crash counts then. A breach of the protocol, for which the daemon sent SIGKILL,
 * counts at once. Where the zygote ended, no job is the cause: their processes can do nothing to it. */
static queue_blame blame_of(const run_env *env, job *j, const isolated_end *end) {
  if (end->broke || (end->status >= 0 && !isolate_was_killed(end->status))) {
    return QUEUE_BLAMED;
  }
  if (end->status == ISOLATE_ORPHAN) {
    return QUEUE_NOT_BLAMED;
  }
  return queue_runs_alone(env->q, j) ? QUEUE_BLAMED : QUEUE_SUSPECTED;
}

static void crashed(const run_env *env, job *j, const isolated_end *end) {
  char fields[128];
  snprintf(fields, sizeof fields, "\"job\":\"%s\"", job_id(j));
  log_write(LOG_ERROR, fields, "the process of the job %s", end->why);
  if (!queue_crashed(env->q, j, blame_of(env, j, end))) {
    return;
  }
  api_problem problem = {0};
  api_text text = {0};
  api_refuse(
      &problem, "job-crashed",
      "The process of this job died %d times, the last time because it %s; the job is not retried. Please report "
      "this as a bug, with its meshes.",
      CRASHES_MOST, end->why);
  api_problem_write(&problem, &text);
  queue_finish(env->q, j, API_JOB_FAILED, text.failed ? NULL : text.data);
  api_text_free(&text);
  api_problem_free(&problem);
}

static int lacks_memory(orb_context *ctx, const api_problem *problem) {
  return problem->name ? strcmp(problem->name, "no-memory") == 0 : orb_context_error(ctx)->status == ORB_E_NO_MEMORY;
}

typedef struct made {
  const run_env *env;
  const resource *row;
} made;

static int is_published(void *user) {
  const made *m = user;
  named_object named[RESOURCE_OBJECTS];
  const int count = resource_objects(m->row, named);
  int there = 1;
  objects_hold_again(m->env->store);
  for (int i = 0; i < count && there; i++) {
    there = objects_look(m->env->store, named[i].kind, m->row->id) == STORE_OK;
  }
  return there;
}

/* row: without JSON, the result existed already. */
static void finish_made(const run_env *env, job *j, const resource *row) {
  if (row->json) {
    made m = {env, row};
    queue_finish_made(env->q, j, &(queue_made){row, is_published, &m});
  } else {
    queue_finish(env->q, j, API_JOB_SUCCEEDED, NULL);
  }
}

static void run_claimed(worker_pool *pool, job *j, int threads, job_spans *spans) {
  job_progress progress = {.q = pool->env.q, .j = j};
  run_env env_of_job = pool->env, *env = &env_of_job;
  env_of_job.progress = &progress;
  env_of_job.tenant = job_owner(j);
  api_problem problem = {0};
  run_output out = {0};
  int64_t began = orb_clock_ms();
  spans_run(spans, env->q, j, &progress);
  orb_context *ctx = begin(pool, j, threads, &progress);
  if (!ctx) {
    return;
  }
  FAULT_POINT("run-begun");
  int embedding = job_kind(j) == API_JOB_EMBEDDING;
  isolated_end end = {0};
  int fine = run_somewhere(pool, env, ctx, j, threads, &out, &problem, &end);
  metrics_flips(out.flips);
  queue_set_context(env->q, j, NULL);
  progress_enter(&progress, "");
  FAULT_POINT("run-done");
  double seconds = 1e-3 * (double)(orb_clock_ms() - began);
  if (job_charged(j)[0]) {
    catalogue_key_use(env->cat, job_charged(j), (int64_t)time(NULL) / 86400, 0, (int64_t)(1e3 * seconds * threads));
  }
  report(j, fine, seconds);
  spans_end(spans, fine ? NULL : end.died ? "job-crashed" : why_failed(ctx, &problem));
  if (end.died) {
    crashed(env, j, &end);
  } else if (fine) {
    if (embedding) {
      queue_add_embed_ms(env->q, j, 1e3 * seconds);
    }
    finish_made(env, j, &out.row);
  } else if (out.gone || (may_be_store(env, began) && !queue_cancel_wanted(env->q, j))) {
    queue_give_back(env->q, j); /* a worker plans it again, once the stores are back */
  } else if (!lacks_memory(ctx, &problem) || !queue_needs_memory(env->q, j)) {
    finish_failed(env, j, ctx, &problem);
  }
  if (out.holds) {
    objects_let_go(env->store);
  }
  resource_free(&out.row);
  api_problem_free(&problem);
  orb_context_destroy(ctx);
}

static void run_one(worker_pool *pool, job *j, int threads) {
  const run_env *env = &pool->env;
  job_spans spans;
  spans_begin(&spans, env->q, j);
  if (queue_cancel_wanted(env->q, j)) {
    queue_finish(env->q, j, API_JOB_CANCELLED, NULL);
    return;
  }
  if (objects_are_away(env->store) || !queue_read_request(env->q, j)) {
    queue_put_off(env->q, j);
    return;
  }
  if (job_kind(j) == API_JOB_FETCH) {
    fetch_one(pool, j, &spans);
    return;
  }
  char *reason = queue_dependency_problem(env->q, j);
  if (reason) {
    queue_finish(env->q, j, API_JOB_FAILED, reason);
    free(reason);
    return;
  }
  int waits = job_kind(j) == API_JOB_SUPERMESH ? plan(env, j) : 0;
  if (waits > 0) {
    spans_queue(&spans);
    return;
  }
  if (waits < 0 || queue_claim(env->q, j) != STORE_OK) {
    queue_put_off(env->q, j);
    return;
  }
  run_claimed(pool, j, threads, &spans);
}

static void *worker_main(void *argument) {
  worker *self = argument;
  job *j;
  int threads;
  /* Gives requests precedence over jobs; threads that a job starts inherit the value. Failure is harmless. */
  (void)setpriority(PRIO_PROCESS, (id_t)gettid(), self->pool->options.nice);
  while (queue_take(self->pool->env.q, self->lane, &j, &threads)) {
    run_one(self->pool, j, threads);
  }
  return NULL;
}

worker_pool *worker_pool_start(const worker_options *options, queue *q, catalogue *cat, objects *store) {
  int computing = options->workers + QUEUE_GUESTS_MAX;
  int lanes = computing + FETCHERS;
  worker_pool *pool = calloc(1, sizeof *pool + (size_t)lanes * sizeof(worker));
  if (!pool) {
    return NULL;
  }
  pool->options = *options;
  pool->env = (run_env){.q = q, .cat = cat, .store = store};
  pool->count = lanes;
  sem_init(&pool->checks, 0, (unsigned)options->workers);
  pool->options.fetch.checks = &pool->checks;
  for (int i = 0; i < lanes; i++) {
    worker *w = &pool->workers[i];
    w->pool = pool;
    w->lane = i >= computing ? QUEUE_FETCHES : i >= options->workers ? QUEUE_GUESTS : QUEUE_COMPUTES;
    w->started = pthread_create(&w->thread, NULL, worker_main, w) == 0;
    if (!w->started && i == 0) {
      free(pool);
      return NULL;
    }
  }
  return pool;
}

void worker_pool_join(worker_pool *pool) {
  for (int i = 0; pool && i < pool->count; i++) {
    if (pool->workers[i].started) {
      pthread_join(pool->workers[i].thread, NULL);
    }
  }
  free(pool);
}
