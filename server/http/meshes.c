/* POST /v1/meshes. The body streams into a temporary file and a hash. Then a thread for checks reads the mesh, repairs
 * it, checks its topology and stores it (intake.h). fetch.c has the form with a URL. */
#include <stdlib.h>
#include <string.h>

#include "http/http.h"
#include "intake.h"
#include "isolate/meter.h"

/* What the caller's unfinished uploads may take of the disk. */
static temporary_limits limits_of(const request *r) {
  const server *srv = r->srv;
  return temporary_limits_of(objects_free_bytes(srv->store), srv->options->disk_reserve, access_largest(r));
}

static void refuse_room(request *r, temporary_room room) {
  if (room == TEMPORARY_OTHERS) {
    reply_refuse(r, "unavailable",
                 "Your unfinished uploads hold as many bytes of the server's disk as they may. Send fewer at once, and "
                 "try again when one has ended.");
  } else {
    reply_refuse(r, "storage-full", "The server's disk has no room for this file. Free some space and try again.");
  }
}

void upload_abandon(request *r) {
  objects_abandon(&r->temp);
  temporary_give(r->srv->arriving, &r->takes);
}

static int read_upload(const request *r, api_upload *out, api_problem *problem) {
  const api_upload_query query = {.name = query_of(r, "name"),
                                  .repair = query_of(r, "repair"),
                                  .handle_size = query_of(r, "handle_size"),
                                  .part = query_of(r, "part"),
                                  .format = query_of(r, "format")};
  return api_upload_read(&query, out, problem);
}

static int64_t announced_bytes(const request *r) {
  const char *length = header_of(r, "Content-Length");
  const unsigned long long bytes = length ? strtoull(length, NULL, 10) : 0;
  return bytes < INT64_MAX / 2 ? (int64_t)bytes : INT64_MAX / 2;
}

void handle_mesh_begin(request *r) {
  server *srv = r->srv;
  api_upload query;
  api_problem problem = {0};
  if (!read_upload(r, &query, &problem)) {
    reply_problem(r, &problem); /* now, before the client sends the whole file */
    return;
  }
  const int64_t announced = announced_bytes(r);
  const temporary_limits limits = limits_of(r);
  r->takes.owner = r->holder;
  const temporary_room room = temporary_look(srv->arriving, &r->takes, announced, &limits);
  if (!r->decoder && !access_takes_file(r, announced, &problem)) { /* a compressed file has another size */
    reply_problem(r, &problem);
    return;
  }
  if (room != TEMPORARY_FREE) {
    refuse_room(r, room);
    return;
  }
  store_result begun = objects_begin(srv->store, &r->temp);
  if (begun != STORE_OK) {
    reply_store(r, begun);
    return;
  }
  api_hash_begin(&r->hash);
}

/* Looks at quota and disk again with each piece: chunked and compressed bodies do not announce their size, and other
 * uploads take space meanwhile. */
void handle_mesh_bytes(request *r, const char *bytes, size_t size) {
  api_problem problem = {0};
  if (!access_takes_file(r, r->received, &problem)) {
    reply_problem(r, &problem);
    return;
  }
  const temporary_limits limits = limits_of(r);
  const temporary_room room = temporary_take(r->srv->arriving, &r->takes, (int64_t)size, &limits);
  if (room != TEMPORARY_FREE) {
    refuse_room(r, room);
    return;
  }
  store_result stored = objects_append(&r->temp, bytes, size);
  if (stored == STORE_OK) {
    api_hash_add(&r->hash, bytes, size);
  } else {
    reply_store(r, stored);
  }
}

static orb_context *context_for_check(const intake_limits *limits) {
  orb_context_options options = {.memory_limit = (size_t)limits->memory,
                                 .threads = 1,
                                 .deadline_ms = limits->deadline_ms,
                                 .max_triangles = limits->max_triangles,
                                 .meter = meter_set};
  orb_context *ctx = NULL;
  return orb_context_create(&options, &ctx) == ORB_OK ? ctx : NULL;
}

/* Other uploads of this tenant have used up the quota. */
static void refuse_over_quota(request *r) {
  api_problem problem = {0};
  callers_recount(r->srv->callers, access_tenant(r));
  if (access_has_room(r, r->received, &problem)) {
    api_refuse(&problem, "quota-exceeded", "Other uploads used up the token's quota for a moment; try again.");
    api_json_member_integer(&problem.facts, "quota", __atomic_load_n(&r->caller->row.quota, __ATOMIC_RELAXED));
  }
  reply_problem(r, &problem);
}

/* The row that was stored, or, if the mesh was there, the one that this tenant sees. If two requests upload the same
 * mesh at once, both get the row that was written first. drops: of the cache, before the row was stored. */
static void reply_stored(request *r, const intake_file *file, intake_stored *stored, unsigned long long drops) {
  server *srv = r->srv;
  store_result result = STORE_ERROR;
  const cached *entry = stored->row.json ? cache_add(srv->descriptions, &stored->row, access_tenant(r), drops)
                                         : find_description(srv, RESOURCE_MESH, file->id, access_tenant(r), &result);
  if (entry) {
    reply_cached(r, 201, entry);
  } else {
    reply_store(r, result);
  }
}

/* Checks the mesh within so many bytes of memory and stores it. 0, and no answer: it needs more, and is_last is not
 * set.
 */
static int store_within(request *r, const intake_file *file, int64_t memory, int is_last) {
  server *srv = r->srv;
  const char *tenant = access_tenant(r);
  intake_stored kept;
  api_problem problem = {0};
  const intake_limits limits = {.memory = memory,
                                .deadline_ms = orb_clock_ms() + 1000 * srv->options->check_seconds,
                                .max_triangles = srv->options->max_triangles,
                                .part = r->away_task.part,
                                .wanted = request_is_wanted,
                                .user = r};
  orb_context *ctx = context_for_check(&limits);
  if (!ctx) {
    reply_refuse(r, "no-memory", "The server has no memory left; try again later.");
    return 1;
  }
  int64_t quota = r->caller ? __atomic_load_n(&r->caller->row.quota, __ATOMIC_RELAXED) : 0;
  const unsigned long long drops = cache_drops(srv->descriptions);
  store_result stored = intake_store(file, srv->cat, srv->store, ctx, &limits, tenant, quota, &kept, &problem);
  orb_context_destroy(ctx);
  if (kept.fresh && r->caller) {
    callers_recount(srv->callers, tenant);
  }
  if (!is_last && problem.name && strcmp(problem.name, "no-memory") == 0) {
    api_problem_free(&problem);
    return 0;
  }
  if (problem.name && strcmp(problem.name, "cancelled") == 0) {
    api_refuse(&problem, "unavailable",
               "The server is stopping, or the connection of this request ended; try again soon.");
  }
  if (problem.name) {
    reply_problem(r, &problem);
    return 1;
  }
  if (stored == STORE_CONFLICT && r->caller) {
    refuse_over_quota(r);
    return 1;
  }
  if (stored == STORE_OK) {
    reply_stored(r, file, &kept, drops);
  } else {
    reply_store(r, stored);
  }
  return 1;
}

static void upload_away(request *r);

/* Checks the file with the memory of the task. 0: it needs more, and the request goes on once there is all that so many
 * bytes can need. */
static int store_mesh(request *r, const intake_file *file) {
  const int fills = (file->upload->options.repair & ORB_REPAIR_FILL_HOLES) != 0;
  const int64_t most = budget_for_densest_file(r->srv->memory, BUDGET_CHECKS, r->received, fills);
  const int done = store_within(r, file, r->away_task.memory, r->away_task.memory >= most);
  if (!done) {
    request_go_on(r, r->srv->large_checks, most, upload_away);
  }
  return done;
}

static void upload_away(request *r) {
  api_upload query;
  api_problem problem = {0};
  intake_file file;
  store_result result;
  int done = 1;
  if (!read_upload(r, &query, &problem)) {
    reply_problem(r, &problem);
    return;
  }
  if (r->away_task.memory == 0) {
    reply_refuse(r, "unavailable", "The server is stopping, or the connection of this request ended; try again soon.");
    return;
  }
  if (!intake_open(&file, &r->temp, &r->hash, r->received, &query)) {
    reply_refuse(r, "no-memory", "The server has no memory left; try again later.");
    return;
  }
  const cached *known = find_description(r->srv, RESOURCE_MESH, file.id, access_tenant(r), &result);
  if (known) {
    intake_restore(&file, r->srv->store);
    reply_cached(r, 200, known);
  } else if (access_has_room(r, r->received, &problem)) {
    done = store_mesh(r, &file);
  } else {
    reply_problem(r, &problem);
  }
  if (done) {
    upload_abandon(r);
  }
  intake_close(&file);
}

enum MHD_Result handle_mesh_file(request *r) {
  const memory_budget *memory = r->srv->memory;
  const int large = r->received > BUDGET_SMALL_FILE;
  r->away_task.part = large ? BUDGET_CHECKS : BUDGET_SMALL;
  r->away_task.memory = large ? budget_for_file(memory, BUDGET_CHECKS, r->received)
                              : budget_for_densest_file(memory, BUDGET_SMALL, r->received, 0);
  return request_go_away(r, large ? r->srv->large_checks : r->srv->checks, upload_away);
}
