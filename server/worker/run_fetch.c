/* A mesh from a URL: downloads the file, then handles it like an upload (intake.h).
 *
 * The download comes before the claim, so that a crash of the process while it waits for a server does not make the job
 * suspect. If the process dies between the commit of the mesh and the end of the job, the job runs again and finds the
 * mesh.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/fetch_codec.h"
#include "hash.h"
#include "intake.h"
#include "net/client.h"
#include "store/owners.h"
#include "worker/run.h"

enum { REDIRECTS = 5, LOOK_BYTES = 1 << 20 };

typedef struct download {
  const run_env *env;
  const fetch_options *options;
  orb_context *ctx;
  object_temp temp;
  temporary_file takes; /* of the disk, for the job's tenant */
  api_hash hash;
  int64_t size;
  int64_t largest; /* the most bytes that the quota allows a file, known or not; 0: no quota */
  temporary_room room;
  store_result stored;
} download;

static int is_over_quota(const download *d) {
  return d->largest > 0 && d->size > d->largest;
}

static int take(void *user, const char *bytes, size_t size) {
  download *d = user;
  int64_t before = d->size / LOOK_BYTES;
  d->size += (int64_t)size;
  if (d->size / LOOK_BYTES != before) {
    progress_report(d->env->progress, "download", (double)d->size / (double)d->options->most);
  }
  if (is_over_quota(d)) {
    return 0;
  }
  const temporary_limits limits =
      temporary_limits_of(objects_free_bytes(d->env->store), d->options->disk_reserve, d->largest);
  d->room = temporary_take(d->options->arriving, &d->takes, (int64_t)size, &limits);
  if (d->room != TEMPORARY_FREE) {
    return 0;
  }
  d->stored = objects_append(&d->temp, bytes, size);
  api_hash_add(&d->hash, bytes, size);
  return d->stored == STORE_OK;
}

static int continues(void *user) {
  return orb_context_check(((download *)user)->ctx) == ORB_OK;
}

static int refuse_url(const api_fetch_request *wish, const char *name, const char *why, api_problem *problem) {
  api_refuse(problem, name, "The file was not fetched: %s.", why);
  api_json_member_string(&problem->facts, "url", wish->url);
  return 0;
}

static int refuse_over_quota(const api_fetch_request *wish, api_problem *problem) {
  api_refuse(problem, "quota-exceeded",
             "The tenant may store %lld bytes of meshes, which leaves no room for this one: delete some meshes, or ask "
             "the operator for a larger quota.",
             (long long)wish->quota);
  api_json_member_integer(&problem->facts, "quota", wish->quota);
  return 0;
}

/* Why a download was given up, if that was for want of room. */
static int refuse_room(const download *d, const api_fetch_request *wish, api_problem *problem) {
  if (is_over_quota(d)) {
    return refuse_over_quota(wish, problem);
  }
  if (d->room == TEMPORARY_OTHERS) {
    return api_refuse(problem, "unavailable",
                      "The tenant's unfinished uploads and downloads hold as many bytes of the server's disk as they "
                      "may. Request the mesh again when one has ended.");
  }
  return task_refuse_store(STORE_FULL, problem);
}

static int refuse(const download *d, const api_fetch_request *wish, const net_answer *answer, api_problem *problem) {
  char why[64];
  if (is_over_quota(d) || d->room != TEMPORARY_FREE) {
    return refuse_room(d, wish, problem);
  }
  if (d->stored != STORE_OK) {
    task_refuse_store(d->stored, problem);
    return 0;
  }
  switch (answer->end) {
    case NET_STOPPED: /* cancelled: the context has the error */
      return 0;
    case NET_FORBIDDEN:
      return refuse_url(wish, "forbidden-address", answer->why, problem);
    case NET_TOO_LARGE:
      api_refuse(problem, "too-large", "The file has more than %lld bytes, the limit of an upload; decimate the mesh.",
                 (long long)d->options->most);
      api_json_member_integer(&problem->facts, "limit", d->options->most);
      return 0;
    case NET_ANSWERED:
      snprintf(why, sizeof why, "its server answered %d", answer->status);
      refuse_url(wish, "fetch-failed", why, problem);
      api_json_member_integer(&problem->facts, "answer", answer->status);
      return 0;
    default:
      return refuse_url(wish, "fetch-failed", answer->why, problem);
  }
}

static int64_t largest_file(const run_env *env, const job *j, const api_fetch_request *wish) {
  const int64_t used = wish->quota > 0 ? catalogue_tenant_bytes(env->cat, job_owner(j)) : 0;
  return owner_largest_file(wish->quota, used);
}

static int get(download *d, const job *j, const api_fetch_request *wish, api_problem *problem) {
  const char *why;
  net_url url;
  net_answer answer = {0};
  net_verdict verdict = net_url_read(wish->url, &d->options->allowed, &url, &why);
  if (verdict != NET_URL_FINE) { /* the configuration has changed since the request */
    return refuse_url(wish, verdict == NET_URL_FORBIDDEN ? "forbidden-address" : "fetch-failed",
                      "its URL is refused now", problem);
  }
  d->stored = objects_begin(d->env->store, &d->temp);
  if (d->stored != STORE_OK) {
    return refuse(d, wish, &answer, problem);
  }
  d->largest = largest_file(d->env, j, wish);
  api_hash_begin(&d->hash);
  progress_report(d->env->progress, "download", 0);
  net_get(&(net_request){.url = &url,
                         .allowed = &d->options->allowed,
                         .authorities = d->options->authorities,
                         .total_ms = d->options->total_ms,
                         .most = d->options->most,
                         .take = take,
                         .continues = continues,
                         .user = d},
          REDIRECTS, &answer);
  int fine = answer.end == NET_ANSWERED && answer.status == 200 && d->stored == STORE_OK;
  return fine || refuse(d, wish, &answer, problem);
}

/* The mesh if the tenant owns it already. */
static store_result known(const run_env *env, const job *j, const char *id) {
  resource row = {0};
  const char *tenant = job_owner(j);
  store_result found = tenant[0] ? catalogue_get_of(env->cat, RESOURCE_MESH, id, tenant, &row)
                                 : catalogue_get(env->cat, RESOURCE_MESH, id, &row);
  resource_free(&row);
  return found;
}

/* Checks and stores the mesh within so many bytes of memory. */
static store_result check_within(download *d, const job *j, const api_fetch_request *wish, const intake_file *file,
                                 int64_t memory, api_problem *problem) {
  intake_stored kept = {0};
  if (!budget_wait(d->options->memory, BUDGET_CHECKS, memory, continues, d)) {
    return STORE_OK; /* cancelled: the context has the error */
  }
  while (sem_wait(d->options->checks) != 0) { /* interrupted by a signal */
  }
  const intake_limits limits = {.memory = memory,
                                .deadline_ms = orb_clock_ms() + d->options->check_ms,
                                .max_triangles = d->options->max_triangles,
                                .part = BUDGET_CHECKS};
  store_result stored =
      intake_store(file, d->env->cat, d->env->store, d->ctx, &limits, job_owner(j), wish->quota, &kept, problem);
  resource_free(&kept.row);
  sem_post(d->options->checks);
  budget_give(d->options->memory, BUDGET_CHECKS, memory, NULL);
  return stored;
}

/* If the file needs more memory than ordinary ones of its size, it is checked again with what the densest need. */
static store_result check(download *d, const job *j, const api_fetch_request *wish, const intake_file *file,
                          api_problem *problem) {
  const int fills = (wish->upload.options.repair & ORB_REPAIR_FILL_HOLES) != 0;
  const int64_t first = budget_for_file(d->options->memory, BUDGET_CHECKS, d->size);
  const int64_t most = budget_for_densest_file(d->options->memory, BUDGET_CHECKS, d->size, fills);
  store_result stored = check_within(d, j, wish, file, first, problem);
  if (first < most && problem->name && strcmp(problem->name, "no-memory") == 0) {
    api_problem_free(problem);
    stored = check_within(d, j, wish, file, most, problem);
  }
  return stored;
}

static int store(download *d, const job *j, const api_fetch_request *wish, char mesh[API_ID_SIZE],
                 api_problem *problem) {
  const run_env *env = d->env;
  intake_file file;
  progress_report(env->progress, "check", 0);
  if (!intake_open(&file, &d->temp, &d->hash, d->size, &wish->upload)) {
    return api_refuse(problem, "no-memory", "The server has no memory left; try again later.");
  }
  memcpy(mesh, file.id, API_ID_SIZE);
  store_result stored = known(env, j, file.id);
  if (stored == STORE_OK) {
    intake_restore(&file, env->store);
  } else if (stored == STORE_NOT_FOUND) {
    stored = check(d, j, wish, &file, problem);
  }
  intake_close(&file);
  if (stored == STORE_CONFLICT) {
    refuse_over_quota(wish, problem);
  } else if (stored != STORE_OK) {
    task_refuse_store(stored, problem);
  }
  return stored == STORE_OK && !problem->name && orb_context_check(d->ctx) == ORB_OK;
}

int run_fetch(const run_env *env, const fetch_options *options, orb_context *ctx, job *j, char mesh[API_ID_SIZE],
              int *claimed, api_problem *problem) {
  download d = {.env = env,
                .options = options,
                .ctx = ctx,
                .temp.fd = -1,
                .takes.owner = tenant_hash(job_owner(j)),
                .room = TEMPORARY_FREE};
  api_fetch_request *wish = malloc(sizeof *wish);
  *claimed = 1;
  int fine = wish ? api_fetch_request_load(job_request(j), wish, problem) && get(&d, j, wish, problem)
                  : api_refuse(problem, "no-memory", "The server has no memory left; try again later.");
  if (fine) {
    *claimed = queue_claim(env->q, j) == STORE_OK;
    fine = *claimed && store(&d, j, wish, mesh, problem);
  }
  objects_abandon(&d.temp);
  temporary_give(options->arriving, &d.takes);
  free(wish);
  return fine;
}
