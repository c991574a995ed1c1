/* POST /v1/meshes. The body streams into a temporary file and a hash. Then a thread for checks reads the mesh, repairs
 * it, checks its topology and stores it. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "api/json.h"
#include "api/mesh_codec.h"
#include "faults.h"
#include "http/http.h"
#include "log.h"
#include "store/owners.h"

enum { LARGE_UPLOAD = 16 << 20, LOOK_BYTES = 1 << 20 };

static void refuse_full(request *r) {
  reply_refuse(r, "storage-full", "The server's disk has no room for this file. Free some space and try again.");
}

void handle_mesh_begin(request *r) {
  server *srv = r->srv;
  upload_query query;
  api_problem problem = {0};
  if (!parse_upload(query_of(r, "name"), query_of(r, "repair"), query_of(r, "format"), &query, &problem)) {
    reply_problem(r, &problem); /* now, before the client sends the whole file */
    return;
  }
  const char *length = header_of(r, "Content-Length");
  uint64_t expected = length ? strtoull(length, NULL, 10) : 0;
  if (expected + (uint64_t)srv->options->disk_reserve > objects_free_bytes(srv->store)) {
    refuse_full(r);
    return;
  }
  store_result begun = objects_begin(srv->store, &r->temp);
  if (begun != STORE_OK) {
    reply_store(r, begun);
    return;
  }
  api_hash_begin(&r->hash);
}

/* Checks the disk reserve again every LOOK_BYTES: chunked and compressed bodies do not announce their size, and other
 * uploads take space meanwhile. */
void handle_mesh_bytes(request *r, const char *bytes, size_t size) {
  const server *srv = r->srv;
  if (r->received / LOOK_BYTES != (r->received - (int64_t)size) / LOOK_BYTES &&
      objects_free_bytes(srv->store) < (uint64_t)srv->options->disk_reserve) {
    refuse_full(r);
    return;
  }
  store_result stored = objects_append(&r->temp, bytes, size);
  if (stored == STORE_OK) {
    api_hash_add(&r->hash, bytes, size);
  } else {
    reply_store(r, stored);
  }
}

/* Maps the upload's bytes into memory; free with unmap_upload(). */
static const unsigned char *map_upload(const request *r) {
  if (r->received == 0) {
    return (const unsigned char *)"";
  }
  void *at = mmap(NULL, (size_t)r->received, PROT_READ, MAP_PRIVATE, r->temp.fd, 0);
  return at == MAP_FAILED ? NULL : at;
}

static void unmap_upload(const request *r, const unsigned char *bytes) {
  if (bytes && r->received > 0) {
    munmap((void *)(uintptr_t)bytes, (size_t)r->received);
  }
}

/* Reads, repairs and checks the mesh; on success *json holds its description. */
static int check_mesh(request *r, const upload_query *query, const unsigned char *bytes, orb_format format,
                      const char *id, int64_t created, api_text *json, api_problem *problem) {
  const config *options = r->srv->options;
  orb_context_options limits = {.memory_limit = (size_t)options->job_memory,
                                .threads = 1,
                                .deadline_ms = orb_clock_ms() + 1000 * options->job_seconds,
                                .max_triangles = options->max_triangles};
  orb_context *ctx = NULL;
  orb_mesh mesh;
  api_mesh_facts facts = {
      .id = id, .name = query->name, .repair = query->repair, .bytes = r->received, .created = created, .mesh = &mesh};
  memset(&mesh, 0, sizeof mesh);
  if (orb_context_create(&limits, &ctx) != ORB_OK) {
    return api_refuse(problem, "no-memory", "The server has no memory left; try again later.");
  }
  orb_format found = format;
  int fine = orb_mesh_read(ctx, bytes, (size_t)r->received, format, &mesh, &found) == ORB_OK &&
             orb_mesh_repair(ctx, &mesh, query->flags) == ORB_OK &&
             orb_mesh_topology(ctx, &mesh, &facts.topology) == ORB_OK;
  if (fine) {
    orb_mesh_extent(&mesh, &facts.extent);
    facts.format = orb_format_name(found);
    api_mesh_write(&facts, json);
    fine = !json->failed || api_refuse(problem, "no-memory", "The server has no memory left; try again later.");
  } else {
    api_problem_of_error(orb_context_error(ctx), problem);
  }
  orb_mesh_free(ctx, &mesh);
  orb_context_destroy(ctx);
  return fine;
}

/* Deletes an object that got no row. */
static void drop_unused(server *srv, const char *id) {
  resource row = {0};
  objects_exclude(srv->store);
  if (catalogue_get(srv->cat, RESOURCE_MESH, id, &row) == STORE_NOT_FOUND) {
    objects_delete(srv->store, OBJECT_MESH, id);
  }
  objects_let_go(srv->store);
  resource_free(&row);
}

/* Checks the mesh even if another tenant already owns it: neither the response nor its time may reveal that. */
static void store_mesh(request *r, const upload_query *query, const unsigned char *bytes, orb_format format,
                       const char *id) {
  server *srv = r->srv;
  const char *tenant = access_tenant(r);
  int fresh = 0;
  api_text json = {0};
  api_problem problem = {0};
  resource row = {.kind = RESOURCE_MESH, .bytes = r->received, .created = (int64_t)time(NULL) * 1000};
  if (!check_mesh(r, query, bytes, format, id, row.created, &json, &problem)) {
    api_text_free(&json);
    reply_problem(r, &problem);
    return;
  }
  memcpy(row.id, id, sizeof row.id);
  api_hash_end(&r->hash, row.sha);
  row.json = json.data;
  objects_hold(srv->store);
  store_result stored = objects_publish(srv->store, &r->temp, OBJECT_MESH, id);
  FAULT_POINT("mesh-published");
  if (stored == STORE_OK) {
    stored = catalogue_put_for(srv->cat, &row, tenant,
                               r->caller ? __atomic_load_n(&r->caller->row.quota, __ATOMIC_RELAXED) : 0, &fresh);
  }
  objects_let_go(srv->store);
  resource_free(&row);
  if (fresh && r->caller) {
    callers_recount(srv->callers, tenant);
  }
  if (stored == STORE_CONFLICT && r->caller) { /* other uploads of this tenant have used up the quota */
    drop_unused(srv, id);
    callers_recount(srv->callers, tenant);
    if (access_has_room(r, r->received, &problem)) {
      api_refuse(&problem, "quota-exceeded", "The token's quota had no room for this mesh; try again.");
      api_json_member_integer(&problem.facts, "quota", __atomic_load_n(&r->caller->row.quota, __ATOMIC_RELAXED));
    }
    reply_problem(r, &problem);
    return;
  }
  /* If two requests upload the same mesh at once, both get the row that was written first. */
  const cached *entry = stored == STORE_OK ? find_description(srv, RESOURCE_MESH, id, tenant, &stored) : NULL;
  if (entry) {
    reply_cached(r, 201, entry);
  } else {
    reply_store(r, stored);
  }
}

/* A known mesh whose file is lost or truncated is restored from this upload. */
static void put_back(request *r, const char *id) {
  int fd;
  uint64_t size = 0;
  store_result found = objects_read(r->srv->store, OBJECT_MESH, id, &fd, &size);
  if (found == STORE_OK) {
    close(fd);
  }
  if (found == STORE_NOT_FOUND || (found == STORE_OK && size != (uint64_t)r->received)) {
    objects_hold(r->srv->store);
    found = objects_publish(r->srv->store, &r->temp, OBJECT_MESH, id);
    objects_let_go(r->srv->store);
    log_warn("the file of mesh %s was lost or truncated and %s", id,
             found == STORE_OK ? "is restored" : "could not be restored");
  }
}

static void upload_away(request *r) {
  upload_query query;
  api_problem problem = {0};
  char id[API_ID_SIZE];
  if (!parse_upload(query_of(r, "name"), query_of(r, "repair"), query_of(r, "format"), &query, &problem)) {
    reply_problem(r, &problem);
    return;
  }
  const unsigned char *bytes = map_upload(r);
  if (!bytes) {
    reply_refuse(r, "no-memory", "The server has no memory left; try again later.");
    return;
  }
  orb_format found = orb_format_detect(bytes, (size_t)r->received);
  int forced = found == ORB_FORMAT_AUTO && query.hint != ORB_FORMAT_AUTO;
  api_mesh_id(&r->hash, query.repair, forced ? orb_format_name(query.hint) : NULL, id);
  store_result result;
  const cached *known = find_description(r->srv, RESOURCE_MESH, id, access_tenant(r), &result);
  if (known) {
    put_back(r, id);
    reply_cached(r, 200, known);
  } else {
    if (access_has_room(r, r->received, &problem)) {
      store_mesh(r, &query, bytes, forced ? query.hint : found, id);
    } else {
      reply_problem(r, &problem);
    }
  }
  unmap_upload(r, bytes);
  objects_abandon(&r->temp);
}

enum MHD_Result handle_mesh_upload(request *r) {
  return request_go_away(r, r->received > LARGE_UPLOAD ? r->srv->large_checks : r->srv->checks, upload_away);
}
