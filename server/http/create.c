/* POST /v1/embeddings and /v1/supermeshes: responds with a known result, or submits a job that makes it. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/json.h"
#include "api/supermesh_codec.h"
#include "api/webhook_codec.h"
#include "http/http.h"
#include "http/read_json.h"
#include "http/room.h"
#include "log.h"
#include "store/deliveries.h"

static int summary_of(request *r, const char *mesh, api_mesh_summary *out, api_problem *problem) {
  server *srv = r->srv;
  store_result result;
  const cached *entry = find_description(srv, RESOURCE_MESH, mesh, access_view(r), &result);
  if (!entry && result == STORE_NOT_FOUND) {
    api_refuse(problem, "not-found", "Mesh %s does not exist: upload it first.", mesh);
    api_json_member_string(&problem->facts, "mesh", mesh);
    return 0;
  }
  int fine = entry && api_mesh_summarise(entry->row.json, out);
  cache_release(srv->descriptions, entry);
  return fine ||
         api_refuse(problem, "internal",
                    "The stored description of the mesh %s cannot be read: DELETE the mesh and upload it again.", mesh);
}

static int no_memory(api_problem *problem) {
  return api_refuse(problem, "no-memory", "The server has no memory left; try again later.");
}

static int read_embedding(request *r, const cJSON *body, wanted_result *out, api_problem *problem) {
  api_embedding_request wish;
  api_mesh_summary mesh;
  if (!api_embedding_request_read(body, &wish, problem) || !summary_of(r, wish.mesh, &mesh, problem)) {
    return 0;
  }
  out->kind = RESOURCE_EMBEDDING;
  out->cost = mesh.triangles;
  api_embedding_request_write(&wish, &out->canonical);
  return (api_embedding_request_id(&wish, out->id) && !out->canonical.failed) || no_memory(problem);
}

int wanted_supermesh(request *r, const cJSON *body, wanted_result *out, api_problem *problem) {
  api_supermesh_request wish;
  api_mesh_summary meshes[API_SHAPES_MAX];
  int fine = api_supermesh_request_read(body, &wish, problem);
  out->kind = RESOURCE_SUPERMESH;
  for (int32_t s = 0; fine && s < wish.shape_count; s++) {
    fine = summary_of(r, wish.shapes[s].mesh, &meshes[s], problem);
    out->cost += fine ? meshes[s].triangles : 0;
  }
  fine = fine && api_supermesh_request_resolve(&wish, meshes, problem);
  if (fine) {
    api_supermesh_request_write(&wish, &out->canonical);
    fine = (api_supermesh_request_id(&wish, out->id) && !out->canonical.failed) || no_memory(problem);
  }
  api_supermesh_request_free(&wish);
  return fine;
}

int check_url(const char *where, const char *url, const networks *allowed, net_url *out, api_problem *problem) {
  const char *why;
  net_verdict verdict = net_url_read(url, allowed, out, &why);
  if (verdict == NET_URL_FORBIDDEN) {
    api_refuse(problem, "forbidden-address", "%s: %s", where, why);
    api_json_member_string(&problem->facts, "url", url);
  } else if (verdict != NET_URL_FINE) {
    api_refuse(problem, "invalid-request", "%s: %s", where, why);
  }
  return verdict == NET_URL_FINE;
}

int read_webhook(request *r, cJSON *body, wanted_result *out, api_problem *problem) {
  api_webhook hook;
  if (!api_webhook_take(body, &hook, problem) || !hook.url[0]) {
    return !problem->name;
  }
  if (!check_url("\"url\" of \"webhook\"", hook.url, &r->srv->webhook_allowed, &out->webhook, problem)) {
    return 0;
  }
  out->events = hook.events;
  return 1;
}

static int read_wish(request *r, wanted_result *out, api_problem *problem) {
  cJSON *body = read_json(r, problem);
  if (!body) {
    return 0;
  }
  int fine = read_webhook(r, body, out, problem);
  if (fine) {
    fine = r->route->id == ROUTE_EMBEDDING_CREATE
               ? read_embedding(r, body, out, problem)
               : resolve_landmarks(r, body, problem) && wanted_supermesh(r, body, out, problem);
  }
  json_done(body);
  return fine;
}

static void reply_accepted(request *r, job *j) {
  api_text json = {0};
  char location[64];
  queue_job_write(r->srv->q, j, &json);
  snprintf(location, sizeof location, "/v1/jobs/%s", job_id(j));
  reply_json(r, 202, &json);
  reply_header(r, "Location", location);
  reply_header(r, "Retry-After", "1");
}

static void log_submitted(const request *r, const job *j, int fresh) {
  char fields[REQUEST_FIELDS + 80];
  request_fields(r, fields);
  size_t n = strlen(fields);
  snprintf(fields + n, sizeof fields - n, ",\"job\":\"%s\"", job_id(j));
  log_write(LOG_INFO, fields, fresh ? "job accepted" : "job already known");
}

static void refuse_submit(request *r, queue_result result, int64_t owner_limit) {
  api_problem problem = {0};
  switch (result) {
    case QUEUE_FULL:
      reply_refuse(r, "queue-full", "The queue is full; try again when some jobs have ended.");
      break;
    case QUEUE_QUOTA:
      api_refuse(&problem, "quota-exceeded",
                 "The token \"%s\" may have at most %lld unfinished jobs; wait for one to end.", r->caller->row.name,
                 (long long)owner_limit);
      api_json_member_integer(&problem.facts, "quota", owner_limit);
      reply_problem(r, &problem);
      break;
    case QUEUE_STOPPING:
      reply_refuse(r, "unavailable", "The daemon is stopping; try again soon.");
      break;
    case QUEUE_WEBHOOKS:
      reply_refuse(r, "invalid-request",
                   "The job already has %d webhooks and takes no more. Omit \"webhook\" and wait for the job.",
                   JOB_WEBHOOKS);
      break;
    case QUEUE_CRASHED:
      reply_refuse(r, "job-crashed",
                   "Three processes that did this work have died, so it is refused until the operator clears it "
                   "(orbmorphd crash clear). Please report this as a bug, with the meshes.");
      break;
    case QUEUE_MESH_GONE:
      reply_refuse(r, "not-found", "A mesh of this request has just been deleted: upload it again.");
      break;
    default:
      reply_store(r, result == QUEUE_STORE_FULL ? STORE_FULL : STORE_ERROR);
  }
}

static api_job_kind kind_of_job(resource_kind result) {
  return result == RESOURCE_EMBEDDING ? API_JOB_EMBEDDING : result == RESOURCE_MESH ? API_JOB_FETCH : API_JOB_SUPERMESH;
}

/* The catalogue holds what jobs ask for, and uploads and results need the rest of the disk: new jobs leave the reserve.
 * A job without room gets that of kept alignments, which the daemon can make again. */
static queue_result submit(request *r, queue_request *wanted, room *space, job **j, int *fresh) {
  const server *srv = r->srv;
  wanted->is_disk_full =
      objects_free_bytes(srv->store) < (uint64_t)strlen(wanted->request) + (uint64_t)srv->options->disk_reserve;
  for (;;) {
    store_result measured = wanted->kind == API_JOB_FETCH ? STORE_OK : room_measure(r, space);
    if (measured != STORE_OK) {
      return QUEUE_ERROR;
    }
    wanted->room = space->quota > 0 ? &space->left : NULL;
    queue_result result = queue_submit(r->srv->q, wanted, j, fresh);
    if (result != QUEUE_ROOM || !room_make(r, queue_needs_of(wanted) - space->left)) {
      return result;
    }
  }
}

void submit_wanted(request *r, const wanted_result *wish) {
  job_webhook hook = {.url = wish->webhook.text, .origin = wish->webhook.origin, .events = wish->events};
  queue_request wanted_job = {.kind = kind_of_job(wish->kind),
                              .key = wish->id,
                              .request = wish->canonical.data,
                              .owner = access_tenant(r),
                              .charged = r->signer ? r->signer->row.name : NULL,
                              .owner_limit = r->caller ? __atomic_load_n(&r->caller->row.jobs, __ATOMIC_RELAXED) : 0,
                              .priority = access_priority(r),
                              .cost = wish->cost,
                              .listed = 1,
                              .trace = r->span,
                              .hook = hook.url[0] ? &hook : NULL};
  job *j = NULL;
  int fresh = 0;
  api_problem problem = {0};
  if (!sign_may_work(r, &problem)) {
    reply_problem(r, &problem);
    return;
  }
  room space = {0};
  queue_result result = submit(r, &wanted_job, &space, &j, &fresh);
  if (result == QUEUE_ROOM) {
    room_refuse(r, &space, queue_needs_of(&wanted_job));
    return;
  }
  if (result != QUEUE_OK) {
    refuse_submit(r, result, wanted_job.owner_limit);
    queue_release(r->srv->q, j);
    return;
  }
  if (fresh && r->caller && !access_view(r)[0]) {
    callers_recount(r->srv->callers, access_tenant(r)); /* the job may have made it an owner of further meshes */
  }
  log_submitted(r, j, fresh);
  memcpy(r->job, job_id(j), sizeof r->job);
  if (r->waits_for_what == WAIT_ASSET || r->wait_until > orb_clock_ms()) {
    r->waits_for = j;
    r->phase = PHASE_WAIT;
    return;
  }
  reply_accepted(r, j);
  queue_release(r->srv->q, j);
}

static void create_away(request *r) {
  wanted_result wish = {0};
  api_problem problem = {0};
  store_result result;
  if (!read_wish(r, &wish, &problem)) {
    reply_problem(r, &problem);
  } else {
    const cached *known = find_description(r->srv, wish.kind, wish.id, access_tenant(r), &result);
    if (known) {
      reply_cached(r, 200, known);
    } else if (result != STORE_NOT_FOUND) {
      reply_store(r, result);
    } else {
      submit_wanted(r, &wish);
    }
  }
  api_text_free(&wish.canonical);
}

enum MHD_Result handle_create(request *r) {
  int64_t wait = read_wait_ms(r);
  if (wait < 0) {
    return MHD_YES;
  }
  r->wait_until = wait ? orb_clock_ms() + wait : 0;
  r->waits_for_what = WAIT_RESULT;
  return request_go_away(r, r->srv->io, create_away);
}
