/* Lists, descriptions and deletion of meshes, embeddings, supermeshes and landmarks. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/supermesh_codec.h"
#include "evict.h"
#include "http/http.h"
#include "http/paging.h"
#include "metrics.h"
#include "store/owners.h"

static resource_kind kind_of(const request *r) {
  return strncmp(r->route->path, "/v1/meshes", 10) == 0       ? RESOURCE_MESH
         : strncmp(r->route->path, "/v1/embeddings", 14) == 0 ? RESOURCE_EMBEDDING
         : strncmp(r->route->path, "/v1/landmarks", 13) == 0  ? RESOURCE_LANDMARKS
                                                              : RESOURCE_SUPERMESH;
}

void note_use(server *srv, const cached *entry) {
  if (__atomic_load_n(&srv->options->derived_bytes, __ATOMIC_RELAXED) > 0 && resource_is_derived(entry->row.kind) &&
      cache_note_use(srv->descriptions, entry, orb_clock_ms())) {
    catalogue_touch(srv->cat, entry->row.kind, entry->row.id);
  }
}

const cached *find_description(server *srv, resource_kind kind, const char *id, const char *view,
                               store_result *result) {
  resource row;
  const cached *entry = cache_find(srv->descriptions, kind, id, view);
  *result = STORE_OK;
  metrics_cache(entry != NULL);
  if (entry) {
    note_use(srv, entry);
    return entry;
  }
  unsigned long long since = cache_drops(srv->descriptions);
  *result = view[0] ? catalogue_get_of(srv->cat, kind, id, view, &row) : catalogue_get(srv->cat, kind, id, &row);
  if (*result != STORE_OK) {
    return NULL;
  }
  if (resource_is_derived(kind)) {
    catalogue_touch(srv->cat, kind, id);
  }
  entry = cache_add(srv->descriptions, &row, view, since);
  *result = entry ? STORE_OK : STORE_ERROR;
  return entry;
}

static void get_away(request *r) {
  store_result result;
  const cached *entry = find_description(r->srv, kind_of(r), r->id, access_view(r), &result);
  if (entry) {
    reply_cached(r, 200, entry);
  } else {
    reply_store(r, result);
  }
}

enum MHD_Result handle_get(request *r) {
  const cached *entry = cache_find(r->srv->descriptions, kind_of(r), r->id, access_view(r));
  if (!entry) {
    return request_go_away(r, r->srv->io, get_away);
  }
  metrics_cache(1);
  note_use(r->srv, entry);
  reply_cached(r, 200, entry);
  return MHD_YES;
}

/* Reads limit, page_token and id_prefix. 1, or 0 with a response. */
static int read_page(request *r, list_page *page) {
  const char *why = PARSE_PAGE_TOKEN, *token = query_of(r, "page_token"), *parameter;
  uint64_t sealed;
  page->prefix = query_of(r, "id_prefix");
  int fine = parse_page(query_of(r, "limit"), token, &page->limit, &sealed, &why);
  page->before = fine && token ? paging_open(r->srv->secret, sealed) : 0;
  fine &= !token || page->before > 0;
  parameter = strcmp(why, PARSE_PAGE_TOKEN) == 0 ? "page_token" : "limit";
  if (fine && page->prefix && !parse_id_prefix(page->prefix)) {
    why = "\"id_prefix\" must be 1 to 64 lower-case hexadecimal digits.";
    parameter = "id_prefix";
    fine = 0;
  }
  if (!fine) {
    reply_bad_query(r, parameter, why);
  }
  return fine;
}

int list_begin(request *r, const char *name, size_t row_size, list_page *page) {
  memset(page, 0, sizeof *page);
  if (!read_page(r, page)) {
    return 0;
  }
  page->rows = calloc((size_t)page->limit + 1, row_size);
  if (!page->rows) {
    reply_refuse(r, "no-memory", "The server has no memory left; try again later.");
    return 0;
  }
  api_json_open(&page->json, '{');
  api_json_key(&page->json, name);
  api_json_open(&page->json, '[');
  return 1;
}

void list_end(request *r, list_page *page, int64_t last, int count) {
  if (count < 0) {
    api_text_free(&page->json);
    free(page->rows);
    reply_store(r, STORE_ERROR);
    return;
  }
  api_json_close(&page->json, ']');
  api_json_key(&page->json, "next_page_token");
  if (count > page->limit) {
    api_text_printf(&page->json, "\"%016llx\"", (unsigned long long)paging_seal(r->srv->secret, last));
  } else {
    api_json_null(&page->json);
  }
  api_json_close(&page->json, '}');
  free(page->rows);
  reply_json(r, 200, &page->json);
}

/* Reads the parameters of a list of supermeshes. 1, or 0 with a response. */
static int read_filter(request *r, list_filter *filter, int *summary) {
  const char *form = query_of(r, "view"), *why = NULL, *parameter = "view";
  filter->mesh = query_of(r, "mesh");
  filter->name = query_of(r, "name");
  *summary = form && strcmp(form, "summary") == 0;
  if (form && !*summary && strcmp(form, "full") != 0) {
    why = "\"view\" must be full or summary.";
  } else if (filter->mesh && !api_id_valid(filter->mesh, strlen(filter->mesh))) {
    parameter = "mesh";
    why = "\"mesh\" must be the id of a mesh, 64 lower-case hexadecimal digits.";
  } else if (filter->name && (strlen(filter->name) >= ORB_NAME_MAX || !*filter->name)) {
    parameter = "name";
    why = "\"name\" must be the name of a shape, of 1 to 127 bytes.";
  }
  if (why) {
    reply_bad_query(r, parameter, why);
  }
  return why == NULL;
}

static int list_rows(const request *r, resource_kind kind, const list_page *page, const list_filter *filter) {
  const char *view = access_view(r);
  if (filter->prefix || filter->mesh || filter->name) {
    return catalogue_list_some(r->srv->cat, kind, view, filter, page->before, page->limit + 1, page->rows);
  }
  return view[0] ? catalogue_list_of(r->srv->cat, kind, view, page->before, page->limit + 1, page->rows)
                 : catalogue_list(r->srv->cat, kind, page->before, page->limit + 1, page->rows);
}

static void list_away(request *r) {
  static const char *const names[RESOURCE_KINDS] = {"meshes", "embeddings", "supermeshes", "landmarks"};
  resource_kind kind = kind_of(r);
  list_filter filter = {0};
  list_page page;
  int64_t last = 0;
  int summary = 0;
  if ((kind == RESOURCE_SUPERMESH && !read_filter(r, &filter, &summary)) ||
      !list_begin(r, names[kind], sizeof(resource), &page)) {
    return;
  }
  filter.prefix = page.prefix;
  resource *rows = page.rows;
  int count = list_rows(r, kind, &page, &filter);
  for (int i = 0; i < count; i++) {
    if (i < page.limit) {
      if (!summary || !api_supermesh_summary(rows[i].json, &page.json)) {
        api_json_raw(&page.json, rows[i].json);
      }
      last = rows[i].seq;
    }
    resource_free(&rows[i]);
  }
  list_end(r, &page, last, count);
}

enum MHD_Result handle_list(request *r) {
  return request_go_away(r, r->srv->io, list_away);
}

/* Deleting a mesh keeps the embeddings and supermeshes derived from it; only unfinished jobs that need it prevent it.
 * A tenant gives up its own ownership; other owners keep the resource. */
static void delete_away(request *r) {
  server *srv = r->srv;
  resource_kind kind = kind_of(r);
  const char *view = access_view(r);
  if (header_of(r, "If-Match") || header_of(r, "If-None-Match")) {
    store_result result;
    const cached *entry = find_description(srv, kind, r->id, view, &result);
    int decided = entry ? reply_conditions(r, entry->etag) : 1;
    if (!entry) {
      reply_store(r, result);
    }
    cache_release(srv->descriptions, entry);
    if (decided) {
      return;
    }
  }
  if (kind == RESOURCE_MESH && queue_needs_mesh(srv->q, r->id, view[0] ? view : NULL)) {
    reply_refuse(r, "in-use", "Unfinished jobs need this mesh: wait until they end, or cancel them.");
    return;
  }
  const evict_env env = {.cat = srv->cat, .store = srv->store, .descriptions = srv->descriptions};
  store_result result = view[0] ? evict_owned(&env, kind, r->id, view) : evict_one(&env, kind, r->id);
  if (result == STORE_OK) {
    if (!resource_is_derived(kind) && view[0]) {
      callers_recount(srv->callers, view);
    } else if (!resource_is_derived(kind) && r->caller) {
      callers_reload(srv->callers); /* updates the used bytes of all its owners */
    }
    reply_empty(r, 204);
  } else {
    reply_store(r, result);
  }
}

enum MHD_Result handle_delete(request *r) {
  return request_go_away(r, r->srv->io, delete_away);
}
