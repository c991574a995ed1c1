#include "store/usage.h"

#include <stdlib.h>

#include "store/rows.h"

static int read_row(sql_statement *st, void *to) {
  usage_row *out = to;
  int64_t *const numbers[] = {&out->meshes,  &out->bytes, &out->derived,       &out->worker_ms,
                              &out->crashes, &out->quota, &out->quota_derived, &out->quota_jobs};
  row_text(st, 0, out->tenant, sizeof out->tenant);
  for (int i = 0; i < 8; i++) {
    *numbers[i] = sql_integer(st, i + 1);
  }
  return 1;
}
static const row_kind usage_rows = {.read = read_row, .size = sizeof(usage_row)};

#define LEAST(column) "coalesce((SELECT min(k." column ") FROM token k WHERE k.tenant=n.name AND k." column ">0), 0)"

int catalogue_usage(catalogue *cat, const char *own, const char *only, int64_t skip, int limit, usage_row *out) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(
      db,
      "WITH n(name) AS (SELECT name FROM tenant UNION SELECT tenant FROM token UNION SELECT ?1)"
      " SELECT n.name, (SELECT count(*) FROM owner o WHERE o.tenant=n.name AND o.kind=0), coalesce(t.bytes, 0),"
      "  coalesce(t.derived+t.requests, 0), coalesce(t.worker_ms, 0),"
      "  (SELECT coalesce(sum(c.count), 0) FROM crash c WHERE c.tenant=n.name)," LEAST("quota_bytes") "," LEAST(
          "quota_derived") "," LEAST("quota_jobs") " FROM n LEFT JOIN tenant t ON t.name=n.name"
                                                   " WHERE ?2 IS NULL OR n.name=?2 ORDER BY n.name LIMIT ?3 OFFSET ?4");
  if (st) {
    sql_bind_text(st, 1, own);
    sql_bind_text(st, 2, only);
    sql_bind_integer(st, 3, limit);
    sql_bind_integer(st, 4, skip);
  }
  return rows_many(cat, db, st, &usage_rows, out, limit);
}

int catalogue_usage_most(catalogue *cat, int limit, usage_row *out) {
  database *db = catalogue_reader(cat);
  sql_statement *st =
      database_statement(db,
                         "SELECT * FROM (SELECT name, 0, bytes, derived+requests, worker_ms, 0, 0, 0, 0 FROM tenant"
                         " ORDER BY bytes+derived+requests DESC, name LIMIT ?1) AS most"
                         " UNION ALL SELECT '', 0, coalesce(sum(bytes), 0), coalesce(sum(derived+requests), 0), "
                         "coalesce(sum(worker_ms), 0),"
                         " 0, 0, 0, 0 FROM tenant");
  if (st) {
    sql_bind_integer(st, 1, limit - 1);
  }
  return rows_many(cat, db, st, &usage_rows, out, limit);
}

int64_t catalogue_tenant_derived(catalogue *cat, const char *tenant) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(db, "SELECT coalesce(sum(derived), 0) FROM tenant WHERE name=?1");
  if (st) {
    sql_bind_text(st, 1, tenant);
  }
  return rows_integer(cat, db, st);
}

int usage_add_time(database *db, const char *tenant, int64_t ms) {
  sql_statement *st = database_statement(db,
                                         "INSERT INTO tenant(name, worker_ms) VALUES(?1, ?2)"
                                         " ON CONFLICT(name) DO UPDATE SET worker_ms=tenant.worker_ms+?2");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, tenant);
  sql_bind_integer(st, 2, ms);
  return database_run_later(db, st, SQL_ANY);
}

typedef struct time_arg {
  char tenant[64];
  int64_t ms;
} time_arg;

static int add_time(database *db, void *arg) {
  const time_arg *t = arg;
  return usage_add_time(db, t->tenant, t->ms);
}

void catalogue_add_time(catalogue *cat, const char *tenant, int64_t ms) {
  time_arg *t = calloc(1, sizeof *t);
  if (t) {
    snprintf(t->tenant, sizeof t->tenant, "%s", tenant);
    t->ms = ms;
    catalogue_write_later(cat, add_time, t);
  }
}
