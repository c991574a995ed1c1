/* Lists, descriptions and deletion of meshes, embeddings and supermeshes. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "evict.h"
#include "http/http.h"
#include "metrics.h"

static resource_kind kind_of(const request *r) {
  return strncmp(r->route->path, "/v1/meshes", 10) == 0       ? RESOURCE_MESH
         : strncmp(r->route->path, "/v1/embeddings", 14) == 0 ? RESOURCE_EMBEDDING
                                                              : RESOURCE_SUPERMESH;
}

void note_use(server *srv, const cached *entry) {
  if (__atomic_load_n(&srv->options->derived_bytes, __ATOMIC_RELAXED) > 0 && entry->row.kind != RESOURCE_MESH &&
      cache_note_use(srv->descriptions, entry, orb_clock_ms())) {
    catalogue_touch(srv->cat, entry->row.kind, entry->row.id);
  }
}

const cached *find_description(server *srv, resource_kind kind, const char *id, store_result *result) {
  resource row;
  const cached *entry = cache_find(srv->descriptions, kind, id);
  *result = STORE_OK;
  metrics_cache(entry != NULL);
  if (entry) {
    note_use(srv, entry);
    return entry;
  }
  unsigned long long since = cache_drops(srv->descriptions);
  *result = catalogue_get(srv->cat, kind, id, &row);
  if (*result != STORE_OK) {
    return NULL;
  }
  if (kind != RESOURCE_MESH) {
    catalogue_touch(srv->cat, kind, id);
  }
  entry = cache_add(srv->descriptions, &row, since);
  *result = entry ? STORE_OK : STORE_ERROR;
  return entry;
}

static void get_away(request *r) {
  store_result result;
  const cached *entry = find_description(r->srv, kind_of(r), r->id, &result);
  if (entry) {
    reply_cached(r, 200, entry);
  } else {
    reply_store(r, result);
  }
}

enum MHD_Result handle_get(request *r) {
  const cached *entry = cache_find(r->srv->descriptions, kind_of(r), r->id);
  if (!entry) {
    return request_go_away(r, r->srv->io, get_away);
  }
  metrics_cache(1);
  note_use(r->srv, entry);
  reply_cached(r, 200, entry);
  return MHD_YES;
}

int read_page(request *r, int *limit, int64_t *before) {
  const char *why;
  int fine = parse_page(query_of(r, "limit"), query_of(r, "page_token"), limit, before, &why);
  if (!fine) {
    reply_refuse(r, "bad-query", "%s", why);
  }
  return fine;
}

static void list_away(request *r) {
  static const char *const names[RESOURCE_KINDS] = {"meshes", "embeddings", "supermeshes"};
  int limit;
  int64_t before;
  if (!read_page(r, &limit, &before)) {
    return;
  }
  resource *rows = calloc((size_t)limit + 1, sizeof *rows);
  if (!rows) {
    reply_refuse(r, "no-memory", "The server has no memory left; try again later.");
    return;
  }
  resource_kind kind = kind_of(r);
  int count = catalogue_list(r->srv->cat, kind, before, limit + 1, rows);
  orb_text json = {0};
  orb_json_open(&json, '{');
  orb_json_key(&json, names[kind]);
  orb_json_open(&json, '[');
  for (int i = 0; i < count && i < limit; i++) {
    orb_json_raw(&json, rows[i].json);
  }
  orb_json_close(&json, ']');
  orb_json_key(&json, "next_page_token");
  if (count > limit) {
    orb_text_printf(&json, "\"%llx\"", (unsigned long long)rows[limit - 1].seq);
  } else {
    orb_json_null(&json);
  }
  orb_json_close(&json, '}');
  for (int i = 0; i < count; i++) {
    resource_free(&rows[i]);
  }
  free(rows);
  reply_json(r, 200, &json);
}

enum MHD_Result handle_list(request *r) {
  return request_go_away(r, r->srv->io, list_away);
}

/* Deleting a mesh leaves what was derived from it; only unfinished jobs that need it stand in the way. */
static void delete_away(request *r) {
  server *srv = r->srv;
  resource_kind kind = kind_of(r);
  if (kind == RESOURCE_MESH && queue_needs_mesh(srv->q, r->id)) {
    reply_refuse(r, "in-use", "Unfinished jobs need this mesh: wait for them, or cancel them.");
    return;
  }
  const evict_env env = {.cat = srv->cat, .store = srv->store, .descriptions = srv->descriptions};
  store_result result = evict_one(&env, kind, r->id);
  if (result == STORE_OK) {
    reply_empty(r, 204);
  } else {
    reply_store(r, result);
  }
}

enum MHD_Result handle_delete(request *r) {
  return request_go_away(r, r->srv->io, delete_away);
}
