/* POST /v1/landmarks, and landmarks that a request names by id. */
#include <string.h>
#include <time.h>

#include "api/landmark_codec.h"
#include "api/options.h"
#include "http/http.h"
#include "http/read_json.h"
#include "store/owners.h"

/* Reads the body: a `landmarks` array, or an object with that member. */
static int read_list(request *r, api_landmark_list *out, api_problem *problem) {
  static const char *const known[] = {"landmarks", NULL};
  cJSON *body = read_json(r, problem);
  memset(out, 0, sizeof *out);
  int fine = body && (!cJSON_IsObject(body) || api_members_known(body, "the request", known, problem)) &&
             api_landmarks_read(body, 0, out, problem);
  json_done(body);
  if (fine && (out->count == 0 || out->shape_count < 2 || out->shape_count > API_SHAPES_MAX)) {
    return api_refuse(
        problem, "bad-landmarks",
        "\"landmarks\" must be an array of at least one landmark with a place for each of 2 to %d shapes.",
        API_SHAPES_MAX);
  }
  return fine;
}

/* The tenant's quota counts landmarks as it counts meshes. */
static void put(request *r, resource *row) {
  server *srv = r->srv;
  const char *tenant = access_tenant(r);
  api_problem problem = {0};
  int fresh = 0;
  store_result stored = STORE_FULL;
  if (objects_free_bytes(srv->store) >= (uint64_t)row->bytes + (uint64_t)srv->options->disk_reserve) {
    stored = catalogue_put_for(srv->cat, row, tenant,
                               r->caller ? __atomic_load_n(&r->caller->row.quota, __ATOMIC_RELAXED) : 0, &fresh);
  }
  if (fresh && r->caller) {
    callers_recount(srv->callers, tenant);
  }
  if (stored == STORE_CONFLICT && r->caller) {
    callers_recount(srv->callers, tenant);
    if (access_has_room(r, row->bytes, &problem)) {
      api_refuse(&problem, "quota-exceeded", "Other requests used up the token's quota for a moment; try again.");
      api_json_member_integer(&problem.facts, "quota", __atomic_load_n(&r->caller->row.quota, __ATOMIC_RELAXED));
    }
    reply_problem(r, &problem);
    return;
  }
  const cached *entry = stored == STORE_OK ? find_description(srv, RESOURCE_LANDMARKS, row->id, tenant, &stored) : NULL;
  if (entry) {
    reply_cached(r, fresh ? 201 : 200, entry);
  } else {
    reply_store(r, stored);
  }
}

static void create_away(request *r) {
  api_landmark_list list;
  api_problem problem = {0};
  api_text json = {0};
  store_result result = STORE_NOT_FOUND;
  resource row = {.kind = RESOURCE_LANDMARKS, .created = (int64_t)time(NULL) * 1000};
  int fine = read_list(r, &list, &problem);
  if (fine) {
    fine = api_landmarks_id(&list, row.id);
    api_landmarks_describe(row.id, &list, row.created, &json);
    if (!fine || json.failed) {
      fine = api_refuse(&problem, "no-memory", "The server has no memory left; try again later.");
    }
  }
  api_landmarks_free(&list);
  const cached *known = fine ? find_description(r->srv, RESOURCE_LANDMARKS, row.id, access_tenant(r), &result) : NULL;
  memcpy(row.sha, row.id, sizeof row.sha);
  row.json = json.data;
  row.bytes = (int64_t)json.size;
  if (!fine) {
    reply_problem(r, &problem);
  } else if (known) {
    reply_cached(r, 200, known);
  } else if (result != STORE_NOT_FOUND) {
    reply_store(r, result);
  } else {
    put(r, &row);
  }
  resource_free(&row);
}

enum MHD_Result handle_landmarks_create(request *r) {
  return request_go_away(r, r->srv->io, create_away);
}

/* The array of stored landmarks; NULL with the problem. */
static cJSON *load(request *r, const char *id, api_problem *problem) {
  store_result result;
  const cached *entry = find_description(r->srv, RESOURCE_LANDMARKS, id, access_view(r), &result);
  if (!entry && result == STORE_NOT_FOUND) {
    api_refuse(problem, "not-found", "Landmarks %s do not exist: POST them to /v1/landmarks first.", id);
    api_json_member_string(&problem->facts, "landmarks", id);
    return NULL;
  }
  cJSON *whole = entry ? read_json_beside(entry->row.json, entry->json_size, problem) : NULL;
  cJSON *list = cJSON_DetachItemFromObjectCaseSensitive(whole, "landmarks");
  cache_release(r->srv->descriptions, entry);
  cJSON_Delete(whole);
  if (!list && (!problem->name || strcmp(problem->name, "malformed-json") == 0)) {
    api_refuse(problem, "internal", "The stored landmarks %s cannot be read: DELETE them and POST them again.", id);
  }
  return list;
}

int resolve_landmarks(request *r, cJSON *body, api_problem *problem) {
  static const char *const known[] = {"id", NULL};
  const cJSON *named = cJSON_GetObjectItemCaseSensitive(body, "landmarks");
  const cJSON *id = cJSON_GetObjectItemCaseSensitive(named, "id");
  if (!cJSON_IsObject(named) || !id) { /* api_supermesh_request_read() refuses other objects */
    return 1;
  }
  if (!api_members_known(named, "\"landmarks\"", known, problem)) {
    return 0;
  }
  if (!cJSON_IsString(id) || !api_id_valid(id->valuestring, strlen(id->valuestring))) {
    return api_refuse(problem, "not-found", "\"id\" of \"landmarks\" is not the id of landmarks. POST them first.");
  }
  cJSON *list = load(r, id->valuestring, problem);
  return list && cJSON_ReplaceItemInObjectCaseSensitive(body, "landmarks", list);
}
