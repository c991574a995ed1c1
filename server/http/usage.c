/* GET /v1/usage: what tenants use, and their limits. */
#include "store/usage.h"

#include <string.h>

#include "http/http.h"

static void write_quotas(const request *r, const usage_row *row, int is_own, api_text *json) {
  int64_t bytes = row->quota, derived = row->quota_derived, jobs = row->quota_jobs;
  if (is_own && r->caller) {
    bytes = __atomic_load_n(&r->caller->row.quota, __ATOMIC_RELAXED);
    derived = __atomic_load_n(&r->caller->row.quota_derived, __ATOMIC_RELAXED);
    jobs = __atomic_load_n(&r->caller->row.jobs, __ATOMIC_RELAXED);
  }
  if (derived == 0 && r->srv->needs_token) {
    derived = __atomic_load_n(&r->srv->options->quota_derived, __ATOMIC_RELAXED);
  }
  api_json_key(json, "quotas");
  api_json_open(json, '{');
  api_json_member_integer(json, "bytes", bytes);
  api_json_member_integer(json, "derived_bytes", derived);
  api_json_member_integer(json, "jobs", jobs);
  api_json_close(json, '}');
}

static void write_tenant(const request *r, const usage_row *row, api_text *json) {
  int running, queued;
  queue_count_of(r->srv->q, row->tenant, &running, &queued);
  api_json_open(json, '{');
  api_json_member_string(json, "tenant", row->tenant);
  api_json_member_integer(json, "meshes", row->meshes);
  api_json_member_integer(json, "bytes", row->bytes);
  api_json_member_integer(json, "derived_bytes", row->derived);
  write_quotas(r, row, strcmp(row->tenant, access_tenant(r)) == 0, json);
  api_json_member_integer(json, "running", running);
  api_json_member_integer(json, "queued", queued);
  api_json_member_number(json, "worker_seconds", 1e-3 * (double)row->worker_ms);
  api_json_member_integer(json, "crashes", row->crashes);
  api_json_close(json, '}');
}

/* A page token stands for the number of tenants before the page. */
static void usage_away(request *r) {
  const char *view = access_view(r);
  list_page page;
  if (!list_begin(r, "tenants", sizeof(usage_row), &page)) {
    return;
  }
  const usage_row *rows = page.rows;
  int count =
      catalogue_usage(r->srv->cat, access_tenant(r), view[0] ? view : NULL, page.before, page.limit + 1, page.rows);
  for (int i = 0; i < count && i < page.limit; i++) {
    write_tenant(r, &rows[i], &page.json);
  }
  list_end(r, &page, page.before + page.limit, count);
}

enum MHD_Result handle_usage(request *r) {
  return request_go_away(r, r->srv->io, usage_away);
}
