#include "store/owners.h"

#include <string.h>

#include "store/rows.h"

/* Adds an owner if absent. json NULL: the owner sees the resource's own description. */
static int owner_insert(database *db, const resource *r, const char *tenant, const char *json) {
  sql_statement *st = database_statement(db,
                                         "INSERT INTO owner(kind, id, tenant, json, bytes, created, derived)"
                                         " VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7) ON CONFLICT DO NOTHING");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_integer(st, 1, (int)r->kind);
  sql_bind_text(st, 2, r->id);
  sql_bind_text(st, 3, tenant);
  sql_bind_text(st, 4, json);
  sql_bind_integer(st, 5, resource_is_derived(r->kind) ? 0 : r->bytes);
  sql_bind_integer(st, 6, r->created);
  sql_bind_integer(st, 7, resource_is_derived(r->kind) ? r->bytes : 0);
  return database_run_later(db, st, SQL_ANY);
}

/* Whether a query returns a row, with kind, id and text (unless NULL) bound. */
static int exists(database *db, const char *sql, int kind, const char *id, const char *text, int *code) {
  sql_statement *st = database_statement(db, sql);
  if (!st) {
    *code = SQL_ERROR;
    return 0;
  }
  sql_bind_integer(st, 1, kind);
  sql_bind_text(st, 2, id);
  if (text) {
    sql_bind_text(st, 3, text);
  }
  int found = sql_step(st);
  sql_reset(st);
  *code = found == SQL_ROW || found == SQL_DONE ? SQL_OK : found;
  return found == SQL_ROW;
}

/* If the result existed before, this owner's description has the time of the owner's job. */
int owner_of_job(database *db, const char *job, int64_t now, int made) {
  sql_statement *st = database_statement(
      db,
      "INSERT INTO owner(kind, id, tenant, json, bytes, created, derived)"
      " SELECT r.kind, r.id, j.owner,"
      "  iif(NOT EXISTS(SELECT 1 FROM owner o WHERE o.kind=r.kind AND o.id=r.id) OR NOT json_valid(r.json), NULL,"
      "   json_set(r.json, '$.created', strftime('%Y-%m-%dT%H:%M:%S', ?2/1000, 'unixepoch') ||"
      "    printf('.%03dZ', ?2%1000))), 0, ?2, r.bytes"
      " FROM job j JOIN resource r ON r.kind=j.kind+1 AND r.id=j.key WHERE j.id=?1 ON CONFLICT DO NOTHING");
  if (st) {
    sql_bind_text(st, 1, job);
    sql_bind_integer(st, 2, now);
  }
  if (made) {
    return database_run_later(db, st, SQL_ANY);
  }
  int code = database_run(db, st);
  if (code != SQL_OK || sql_changes(db) > 0) {
    return code;
  }
  int there = exists(db, "SELECT 1 FROM job j JOIN resource r ON r.kind=j.kind+1 AND r.id=j.key WHERE ?1=0 AND j.id=?2",
                     0, job, NULL, &code);
  return code == SQL_OK && !there ? SQL_CONSTRAINT : code;
}

/* The meshes that the request ?1 names, for a query that follows. */
#define NAMED                                                              \
  "WITH given(request) AS (SELECT iif(json_valid(?1), ?1, '{}')),"         \
  " named(id) AS (SELECT json_extract(request, '$.mesh') FROM given UNION" \
  "  SELECT json_extract(shape.value, '$.mesh') FROM given, json_each(request, '$.shapes') AS shape)"
#define NAMED_POSTGRESQL                                                                                         \
  "WITH given(request) AS (SELECT iif(json_valid(?1), ?1, '{}')::json),"                                         \
  " named(id) AS (SELECT request->>'mesh' FROM given UNION SELECT shape->>'mesh' FROM given,"                    \
  "  json_array_elements(CASE json_typeof(request->'shapes') WHEN 'array' THEN request->'shapes' ELSE '[]' END)" \
  "  AS shape)"
#define OWN_NAMED                                                                               \
  "INSERT INTO owner(kind, id, tenant, json, bytes, created)"                                   \
  " SELECT 0, r.id, ?2, iif(json_valid(r.json), json_set(r.json, '$.name', '', '$.created',"    \
  "  strftime('%Y-%m-%dT%H:%M:%S', ?3/1000, 'unixepoch') || printf('.%03dZ', ?3%1000)), NULL)," \
  "  r.bytes, ?3 FROM named n JOIN resource r ON r.kind=0 AND r.id=n.id"                        \
  " WHERE NOT EXISTS(SELECT 1 FROM owner o WHERE o.kind=0 AND o.id=r.id AND o.tenant=?2)"
#define LACKS_NAMED                                             \
  "SELECT 1 FROM named n WHERE n.id IS NOT NULL AND NOT EXISTS" \
  " (SELECT 1 FROM resource r WHERE r.kind=0 AND r.id=n.id)"

/* Usually the tenant owns the meshes already; an operator may name those of others. The new owner's description then
 * omits the first owner's name and time. */
int owner_of_meshes(database *db, const char *request, const char *tenant, int64_t now, int all) {
  sql_statement *st = database_statement(db, database_either(db, NAMED OWN_NAMED, NAMED_POSTGRESQL OWN_NAMED));
  int code = SQL_ERROR;
  if (st) {
    sql_bind_text(st, 1, request);
    sql_bind_text(st, 2, tenant);
    sql_bind_integer(st, 3, now);
    code = database_run(db, st);
  }
  if (code != SQL_OK || !all) {
    return code;
  }
  st = database_statement(db, database_either(db, NAMED LACKS_NAMED, NAMED_POSTGRESQL LACKS_NAMED));
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, request);
  code = sql_step(st);
  sql_reset(st);
  return code == SQL_DONE ? SQL_OK : code == SQL_ROW ? SQL_NOTFOUND : code;
}

static const char owner_exists[] = "SELECT 1 FROM owner WHERE kind=?1 AND id=?2 AND tenant=?3";

typedef struct put_arg {
  const resource *row;
  const char *tenant;
  int64_t quota;
  int fresh;
} put_arg;

static int bytes_of(database *db, const char *tenant, int64_t *bytes) {
  sql_statement *st = database_statement(db, "SELECT bytes FROM tenant WHERE name=?1");
  *bytes = 0;
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, tenant);
  int code = sql_step(st);
  if (code == SQL_ROW) {
    *bytes = sql_integer(st, 0);
  }
  sql_reset(st);
  return code == SQL_ROW || code == SQL_DONE ? SQL_OK : code;
}

static int put(database *db, void *arg) {
  put_arg *p = arg;
  int code;
  int64_t bytes = 0;
  p->fresh = 0;
  if (exists(db, owner_exists, (int)p->row->kind, p->row->id, p->tenant, &code) || code != SQL_OK) {
    return code;
  }
  if (p->quota > 0 && (code = bytes_of(db, p->tenant, &bytes)) != SQL_OK) {
    return code;
  }
  if (p->quota > 0 && bytes + p->row->bytes > p->quota) {
    return SQL_CONSTRAINT;
  }
  int first = 0;
  code = resource_insert(db, p->row, &first);
  if (code == SQL_OK) {
    code = owner_insert(db, p->row, p->tenant, first ? NULL : p->row->json);
  }
  p->fresh = code != SQL_OK ? 0 : first ? PUT_FIRST : PUT_SHARED;
  return code;
}

store_result catalogue_put_for(catalogue *cat, const resource *r, const char *tenant, int64_t quota, int *fresh) {
  put_arg arg = {.row = r, .tenant = tenant, .quota = quota};
  store_result result = catalogue_write_held(cat, put, &arg);
  *fresh = result == STORE_OK ? arg.fresh : 0;
  return result;
}

typedef struct alignment_arg {
  const resource *row;
  const char *tenant;
} alignment_arg;

static int put_alignment(database *db, void *arg) {
  const alignment_arg *a = arg;
  sql_statement *st = database_statement(db, "DELETE FROM resource WHERE kind=4 AND id=?1");
  if (st) {
    sql_bind_text(st, 1, a->row->id);
  }
  int code = database_run_later(db, st, SQL_ANY);
  code = code == SQL_OK ? resource_insert(db, a->row, NULL) : code;
  return code == SQL_OK ? owner_insert(db, a->row, a->tenant, NULL) : code;
}

store_result catalogue_put_alignment(catalogue *cat, const resource *row, const char *tenant) {
  return catalogue_write_held(cat, put_alignment, &(alignment_arg){row, tenant});
}

#define COLUMNS \
  "o.seq, r.kind, r.id, r.sha, coalesce(o.json, r.json), r.bytes, o.created, r.places, r.quantized, r.meshopt"
#define LIST_COLUMNS                          \
  "o.seq, r.kind, r.id, r.sha, " ROW_SUMMARY( \
      "r.kind", "coalesce(o.json, r.json)") ", r.bytes, o.created, r.places, r.quantized, r.meshopt"
#define OWNED " FROM owner o JOIN resource r ON r.kind=o.kind AND r.id=o.id"

store_result catalogue_get_of(catalogue *cat, resource_kind kind, const char *id, const char *tenant, resource *out) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(db, "SELECT " COLUMNS OWNED " WHERE o.kind=?1 AND o.id=?2 AND o.tenant=?3");
  if (st) {
    sql_bind_integer(st, 1, (int)kind);
    sql_bind_text(st, 2, id);
    sql_bind_text(st, 3, tenant);
  }
  return rows_one(cat, db, st, &resource_rows, out);
}

static int read_id(sql_statement *st, void *out) {
  row_text(st, 0, out, API_ID_SIZE);
  return 1;
}

/* In PostgreSQL with one question. */
static store_result owns_at_once(catalogue *cat, resource_kind kind, char (*ids)[API_ID_SIZE], int count,
                                 const char *tenant, int *owns) {
  static const row_kind id_rows = {.read = read_id, .size = API_ID_SIZE};
  api_text list = {0};
  for (int i = 0; i < count; i++) {
    api_text_printf(&list, "%s%s", i ? "," : "", ids[i]);
  }
  char(*found)[API_ID_SIZE] = list.failed ? NULL : calloc((size_t)count, sizeof *found);
  int n = -1;
  if (found) {
    database *db = catalogue_reader(cat);
    sql_statement *st =
        database_statement(db, "SELECT id FROM owner WHERE kind=?3 AND tenant=?2 AND id=ANY(string_to_array(?1, ','))");
    if (st) {
      sql_bind_text(st, 1, list.data);
      sql_bind_text(st, 2, tenant);
      sql_bind_integer(st, 3, (int)kind);
    }
    n = rows_many(cat, db, st, &id_rows, found, count);
  }
  for (int i = 0; i < count; i++) {
    for (int k = 0; k < n; k++) {
      owns[i] |= strcmp(found[k], ids[i]) == 0;
    }
  }
  api_text_free(&list);
  free(found);
  return n >= 0 ? STORE_OK : STORE_ERROR;
}

store_result catalogue_owns(catalogue *cat, resource_kind kind, char (*ids)[API_ID_SIZE], int count, const char *tenant,
                            int *owns) {
  memset(owns, 0, (size_t)count * sizeof *owns);
  if (count > 0 && database_is_url(catalogue_path(cat))) {
    return owns_at_once(cat, kind, ids, count, tenant, owns);
  }
  for (int i = 0; i < count; i++) {
    resource known = {0};
    store_result found = catalogue_get_of(cat, kind, ids[i], tenant, &known);
    resource_free(&known);
    owns[i] = found == STORE_OK;
    if (found == STORE_ERROR) {
      return found;
    }
  }
  return STORE_OK;
}

int catalogue_list_of(catalogue *cat, resource_kind kind, const char *tenant, int64_t before, int limit,
                      resource *out) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(db, "SELECT " LIST_COLUMNS OWNED
                                             " WHERE o.tenant=?1 AND o.kind=?2 AND o.seq<?3"
                                             " ORDER BY o.seq DESC LIMIT ?4");
  if (st) {
    sql_bind_text(st, 1, tenant);
    sql_bind_integer(st, 2, (int)kind);
    sql_bind_integer(st, 3, before > 0 ? before : INT64_MAX);
    sql_bind_integer(st, 4, limit);
  }
  return rows_many(cat, db, st, &resource_rows, out, limit);
}

typedef struct disown_arg {
  int kind, gone;
  const char *id, *tenant;
} disown_arg;

static int disown(database *db, void *arg) {
  disown_arg *d = arg;
  sql_statement *st = database_statement(db, "DELETE FROM owner WHERE kind=?1 AND id=?2 AND tenant=?3");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_integer(st, 1, d->kind);
  sql_bind_text(st, 2, d->id);
  sql_bind_text(st, 3, d->tenant);
  int code = database_run(db, st);
  if (code != SQL_OK || sql_changes(db) == 0) {
    return code == SQL_OK ? SQL_NOTFOUND : code;
  }
  d->gone = !exists(db, "SELECT 1 FROM owner WHERE kind=?1 AND id=?2", d->kind, d->id, NULL, &code);
  return code == SQL_OK && d->gone ? resource_remove(db, (resource_kind)d->kind, d->id) : code;
}

store_result catalogue_disown(catalogue *cat, resource_kind kind, const char *id, const char *tenant, int *gone) {
  disown_arg arg = {.kind = (int)kind, .id = id, .tenant = tenant};
  store_result result = catalogue_write(cat, disown, &arg);
  *gone = result == STORE_OK && arg.gone;
  return result;
}

int64_t catalogue_tenant_bytes(catalogue *cat, const char *tenant) {
  int64_t bytes = 0;
  database *db = catalogue_reader(cat);
  int code = bytes_of(db, tenant, &bytes);
  catalogue_reader_done(cat, db);
  return code == SQL_OK ? bytes : -1;
}

int catalogue_alignments_of(catalogue *cat, const char *tenant, int limit, char (*ids)[API_ID_SIZE]) {
  static const row_kind kind = {.read = read_id, .size = API_ID_SIZE};
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(db, "SELECT id FROM owner WHERE tenant=?1 AND kind=4 ORDER BY seq LIMIT ?2");
  if (st) {
    sql_bind_text(st, 1, tenant);
    sql_bind_integer(st, 2, limit);
  }
  return rows_many(cat, db, st, &kind, ids, limit);
}

int64_t catalogue_mismatches(catalogue *cat) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(db,
                                         "SELECT (SELECT count(*) FROM resource r WHERE r.kind!=4 AND NOT EXISTS"
                                         "  (SELECT 1 FROM owner o WHERE o.kind=r.kind AND o.id=r.id))"
                                         " + (SELECT count(*) FROM owner o WHERE NOT EXISTS"
                                         "  (SELECT 1 FROM resource r WHERE r.kind=o.kind AND r.id=o.id))"
                                         " + (SELECT count(*) FROM tenant t WHERE t.bytes !="
                                         "  (SELECT coalesce(sum(o.bytes), 0) FROM owner o WHERE o.tenant=t.name)"
                                         "  OR t.derived !="
                                         "  (SELECT coalesce(sum(o.derived), 0) FROM owner o WHERE o.tenant=t.name))"
                                         " + (SELECT count(*) FROM tenant t WHERE t.requests !="
                                         "  (SELECT coalesce(sum(j.request_bytes), 0) FROM job j WHERE j.owner=t.name))"
                                         " + (SELECT count(*) FROM owner o JOIN resource r"
                                         "  ON r.kind=o.kind AND r.id=o.id"
                                         "  WHERE o.derived != iif(r.kind IN (1, 2, 4), r.bytes, 0))"
                                         " + (SELECT count(*) FROM total t WHERE t.bytes !="
                                         "  (SELECT coalesce(sum(r.bytes), 0) FROM resource r WHERE r.kind=t.kind))"
                                         " + (SELECT count(*) FROM (SELECT seq, key FROM shape_of EXCEPT"
                                         "  SELECT seq, key FROM shape WHERE view='') AS lacking)"
                                         " + (SELECT count(*) FROM (SELECT seq, key FROM shape WHERE view='' EXCEPT"
                                         "  SELECT seq, key FROM shape_of) AS invented)");
  return rows_integer(cat, db, st);
}
