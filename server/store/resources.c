/* Rows of resources. */
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "store/rows.h"

#define COLUMNS "seq, kind, id, sha, json, bytes, created, places, quantized, meshopt"
#define LIST_COLUMNS(json) \
  "seq, kind, id, sha, " ROW_SUMMARY("kind", json) ", bytes, created, places, quantized, meshopt"

void resource_free(resource *r) {
  free(r->json);
  r->json = NULL;
}

resource_kind resource_of_object(object_kind kind) {
  return kind == OBJECT_MESH        ? RESOURCE_MESH
         : kind == OBJECT_SPHERE    ? RESOURCE_EMBEDDING
         : kind == OBJECT_ALIGNMENT ? RESOURCE_ALIGNMENT
                                    : RESOURCE_SUPERMESH;
}

int resource_places_are_joined(const resource *row) {
  return strcmp(row->places, RESOURCE_PLACES_JOINED) == 0;
}

int resource_objects(const resource *row, named_object out[RESOURCE_OBJECTS]) {
  static const object_kind kinds[RESOURCE_KINDS] = {OBJECT_MESH, OBJECT_SPHERE, OBJECT_ASSET, OBJECT_KINDS,
                                                    OBJECT_ALIGNMENT};
  static const char *const profiles[PROFILES_STORED] = {"its profile \"quantized\"", "its profile \"meshopt\""};
  int count = 0;
  if (kinds[row->kind] != OBJECT_KINDS) {
    out[count++] = (named_object){kinds[row->kind], "its object", row->sha};
  }
  /* Supermeshes of older engines have no aligned spheres; their descriptions do not name any. */
  int spheres = row->kind == RESOURCE_SUPERMESH && strstr(row->json, "\"sphere\":") != NULL;
  if (row->kind == RESOURCE_SUPERMESH && (row->places[0] || spheres) && !resource_places_are_joined(row)) {
    out[count++] = (named_object){OBJECT_PLACES, "its places file", row->places};
  }
  if (spheres) {
    out[count++] = (named_object){OBJECT_SPHERES, "its file of aligned spheres", ""};
  }
  for (int p = 0; p < PROFILES_STORED; p++) {
    if (row->profiles[p][0]) {
      out[count++] = (named_object){object_of_profile(p), profiles[p], row->profiles[p]};
    }
  }
  return count;
}

static sql_statement *insert_statement(database *db, const resource *r) {
  sql_statement *st = database_statement(db,
                                         "INSERT INTO resource(kind, id, sha, json, bytes, created, used, places)"
                                         " VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?6, ?7) ON CONFLICT(kind, id) DO NOTHING");
  if (st) {
    sql_bind_integer(st, 1, (int)r->kind);
    sql_bind_text(st, 2, r->id);
    sql_bind_text(st, 3, r->sha);
    sql_bind_text(st, 4, r->json);
    sql_bind_integer(st, 5, r->bytes);
    sql_bind_integer(st, 6, r->created);
    sql_bind_text(st, 7, r->places);
  }
  return st;
}

int resource_insert(database *db, const resource *r, int *fresh) {
  if (!fresh) {
    return database_run_later(db, insert_statement(db, r), SQL_ANY);
  }
  int code = database_run(db, insert_statement(db, r));
  *fresh = code == SQL_OK && sql_changes(db) > 0;
  return code;
}

static int read_row(sql_statement *st, void *to) {
  resource *out = to;
  memset(out, 0, sizeof *out);
  out->seq = sql_integer(st, 0);
  out->kind = (resource_kind)sql_int(st, 1);
  row_text(st, 2, out->id, sizeof out->id);
  row_text(st, 3, out->sha, sizeof out->sha);
  out->json = row_copy(st, 4);
  out->bytes = sql_integer(st, 5);
  out->created = sql_integer(st, 6);
  row_text(st, 7, out->places, sizeof out->places);
  for (int p = 0; p < PROFILES_STORED; p++) {
    row_text(st, 8 + p, out->profiles[p], sizeof out->profiles[p]);
  }
  return out->json != NULL;
}
static void release_row(void *row) {
  resource_free(row);
}
const row_kind resource_rows = {read_row, release_row, sizeof(resource)};

store_result catalogue_get(catalogue *cat, resource_kind kind, const char *id, resource *out) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(db, "SELECT " COLUMNS " FROM resource WHERE kind=?1 AND id=?2");
  if (st) {
    sql_bind_integer(st, 1, (int)kind);
    sql_bind_text(st, 2, id);
  }
  return rows_one(cat, db, st, &resource_rows, out);
}

/* In PostgreSQL with one question. */
static store_result get_at_once(catalogue *cat, const resource_key *keys, int count, resource *out) {
  api_text ids = {0};
  int found = 0;
  for (int i = 0; i < count; i++) {
    api_text_printf(&ids, "%s%s", i ? "," : "", keys[i].id);
  }
  resource *rows = ids.failed ? NULL : calloc(RESOURCE_KINDS * (size_t)count, sizeof *rows);
  if (rows) {
    database *db = catalogue_reader(cat);
    sql_statement *st = database_statement(
        db, "SELECT " COLUMNS " FROM resource WHERE kind IN (0, 1, 2, 3, 4) AND id=ANY(string_to_array(?1, ','))");
    if (st) {
      sql_bind_text(st, 1, ids.data);
    }
    found = rows_many(cat, db, st, &resource_rows, rows, RESOURCE_KINDS * count);
  }
  for (int i = 0; i < count; i++) {
    for (int k = 0; k < found; k++) {
      if (rows[k].json && rows[k].kind == keys[i].kind && strcmp(rows[k].id, keys[i].id) == 0) {
        out[i] = rows[k];
        rows[k].json = NULL;
      }
    }
  }
  for (int k = 0; k < found; k++) {
    resource_free(&rows[k]);
  }
  api_text_free(&ids);
  store_result result = rows && found >= 0 ? STORE_OK : STORE_ERROR;
  free(rows);
  return result;
}

store_result catalogue_get_all(catalogue *cat, const resource_key *keys, int count, resource *out) {
  memset(out, 0, (size_t)count * sizeof *out);
  if (count > 0 && database_is_url(catalogue_path(cat))) {
    return get_at_once(cat, keys, count, out);
  }
  for (int i = 0; i < count; i++) {
    if (catalogue_get(cat, keys[i].kind, keys[i].id, &out[i]) == STORE_ERROR) {
      while (i > 0) {
        resource_free(&out[--i]);
      }
      return STORE_ERROR;
    }
  }
  return STORE_OK;
}

int catalogue_list(catalogue *cat, resource_kind kind, int64_t before, int limit, resource *out) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(
      db, "SELECT " LIST_COLUMNS("json") " FROM resource WHERE kind=?1 AND seq<?2 ORDER BY seq DESC LIMIT ?3");
  if (st) {
    sql_bind_integer(st, 1, (int)kind);
    sql_bind_integer(st, 2, before > 0 ? before : INT64_MAX);
    sql_bind_integer(st, 3, limit);
  }
  return rows_many(cat, db, st, &resource_rows, out, limit);
}

int catalogue_oldest(catalogue *cat, int64_t before, int skip, int limit, resource *out) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(
      db, "SELECT " COLUMNS " FROM resource WHERE kind IN (1, 2, 4) AND used<?2 ORDER BY used, seq LIMIT ?1 OFFSET ?3");
  if (st) {
    sql_bind_integer(st, 3, skip);
    sql_bind_integer(st, 1, limit);
    sql_bind_integer(st, 2, before);
  }
  return rows_many(cat, db, st, &resource_rows, out, limit);
}

typedef struct key_arg {
  int kind;
  char id[API_ID_SIZE];
  int64_t now;
} key_arg;

int resource_remove(database *db, resource_kind kind, const char *id) {
  sql_statement *st = database_statement(db, "DELETE FROM resource WHERE kind=?1 AND id=?2");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_integer(st, 1, (int)kind);
  sql_bind_text(st, 2, id);
  int code = database_run(db, st);
  return code == SQL_OK && sql_changes(db) == 0 ? SQL_NOTFOUND : code;
}

static int delete_row(database *db, void *arg) {
  const key_arg *key = arg;
  return resource_remove(db, (resource_kind)key->kind, key->id);
}

store_result catalogue_delete(catalogue *cat, resource_kind kind, const char *id) {
  key_arg key = {.kind = (int)kind};
  memcpy(key.id, id, sizeof key.id);
  return catalogue_write(cat, delete_row, &key);
}

static int touch_row(database *db, void *arg) {
  key_arg *key = arg;
  sql_statement *st = database_statement(db, "UPDATE resource SET used=?3 WHERE kind=?1 AND id=?2");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_integer(st, 1, key->kind);
  sql_bind_text(st, 2, key->id);
  sql_bind_integer(st, 3, key->now);
  return database_run_later(db, st, SQL_ANY);
}

void catalogue_touch(catalogue *cat, resource_kind kind, const char *id) {
  key_arg *key = calloc(1, sizeof *key);
  if (key) {
    key->kind = (int)kind;
    memcpy(key->id, id, sizeof key->id);
    key->now = (int64_t)time(NULL) * 1000;
    catalogue_write_gathered(cat, touch_row, key);
  }
}

typedef struct profile_arg {
  const char *id, *sha;
  int profile;
  int64_t bytes;
} profile_arg;

/* A profile that was lost and is made again has been counted already. */
static int add_profile(database *db, void *arg) {
  static const char *const updates[PROFILES_STORED] = {
      "UPDATE resource SET bytes=bytes+iif(quantized='', ?3, 0), quantized=?2 WHERE kind=2 AND id=?1",
      "UPDATE resource SET bytes=bytes+iif(meshopt='', ?3, 0), meshopt=?2 WHERE kind=2 AND id=?1"};
  const profile_arg *p = arg;
  sql_statement *st = database_statement(db, updates[p->profile]);
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, p->id);
  sql_bind_text(st, 2, p->sha);
  sql_bind_integer(st, 3, p->bytes);
  int code = database_run(db, st);
  return code == SQL_OK && sql_changes(db) == 0 ? SQL_NOTFOUND : code;
}

store_result catalogue_add_profile(catalogue *cat, const char *id, int profile, const char *sha, int64_t bytes) {
  profile_arg arg = {.id = id, .sha = sha, .profile = profile, .bytes = bytes};
  return catalogue_write_held(cat, add_profile, &arg);
}

int64_t catalogue_bytes(catalogue *cat, int derived_only) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(db, "SELECT sum(bytes) FROM total WHERE ?1=0 OR kind IN (1, 2, 4)");
  if (st) {
    sql_bind_integer(st, 1, derived_only ? 1 : 0);
  }
  return rows_integer(cat, db, st);
}

int resource_secret(database *db, unsigned char out[CATALOGUE_SECRET]) {
  sql_statement *st = database_statement(db, "SELECT bytes FROM secret");
  int size = 0, code = st ? sql_step(st) : SQL_ERROR;
  const void *bytes = code == SQL_ROW ? sql_bytes(st, 0, &size) : NULL;
  if (bytes && size == CATALOGUE_SECRET) {
    memcpy(out, bytes, CATALOGUE_SECRET);
  }
  sql_reset(st);
  return code != SQL_ROW && code != SQL_DONE ? code : size == CATALOGUE_SECRET ? SQL_OK : SQL_ERROR;
}

store_result catalogue_secret(catalogue *cat, unsigned char out[CATALOGUE_SECRET]) {
  database *db = catalogue_reader(cat);
  int code = resource_secret(db, out);
  catalogue_reader_done(cat, db);
  return code == SQL_OK ? STORE_OK : STORE_ERROR;
}

static int glance(database *db, catalogue_glance *out) {
  int code = resource_secret(db, out->secret);
  sql_statement *st =
      code == SQL_OK ? database_statement(db, "SELECT 1 FROM resource WHERE kind!=3 LIMIT 1") : NULL; /* 3: landmarks */
  if (st) {
    code = sql_step(st);
    out->names_objects = code == SQL_ROW;
    sql_reset(st);
  }
  return code == SQL_ROW || code == SQL_DONE ? SQL_OK : code == SQL_OK ? SQL_ERROR : code;
}

store_result catalogue_peek(const char *url, catalogue_glance *out) {
  database db;
  int version = 0, code = database_open(url, SQL_READS, &db);
  if (code != SQL_OK) {
    return catalogue_opened(code, 1);
  }
  code = db.connection.driver->version(&db.connection, &version);
  if (code == SQL_OK && version > 0) {
    code = glance(&db, out);
  }
  if (code != SQL_OK) {
    log_error("the catalogue in PostgreSQL cannot be read: %s", db.connection.driver->message(&db.connection));
  }
  database_close(&db);
  return code == SQL_OK && version == 0 ? STORE_NOT_FOUND : catalogue_opened(code, 1);
}

/* describes: whether a row's description is valid JSON with the row's own id. */
#define DAMAGED(describes)                                                                  \
  "SELECT (SELECT count(*) FROM resource WHERE NOT (" describes                             \
  ")) + (SELECT count(*) FROM owner WHERE json IS NOT NULL AND NOT (" describes             \
  ")) + (SELECT count(*) FROM job WHERE kind NOT IN (0, 1, 2) OR state NOT BETWEEN 0 AND 4" \
  "  OR NOT json_valid(request)) + (SELECT CASE count(*) WHEN 1 THEN 0 ELSE 1 END FROM secret WHERE length(bytes)=16)"

int64_t catalogue_damaged(catalogue *cat) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(
      db,
      database_either(db, DAMAGED("iif(json_valid(json), json_extract(json, '$.id') IS id, 0)"),

                      DAMAGED("CASE WHEN json_valid(json) THEN coalesce(json::json->>'id'=id, false) ELSE false END")));
  return rows_integer(cat, db, st);
}

/* SQLite only: PostgreSQL verifies its pages itself (initdb --data-checksums). The pragma's first row is "ok", or the
 * first finding. A connection of its own: pages that another one has in memory hide what is wrong on the disk. */
static int check_with(catalogue *cat, const char *pragma, char *why, size_t size) {
  database db = {0};
  sql_statement *st = NULL;
  if (database_is_url(catalogue_path(cat))) {
    return 1;
  }
  snprintf(why, size, "it cannot be read");
  if (database_open(catalogue_path(cat), 0, &db) == SQL_OK) {
    st = database_statement(&db, pragma);
  }
  if (st) {
    if (sql_step(st) == SQL_ROW) {
      row_text(st, 0, why, size);
    }
    sql_reset(st);
  }
  database_close(&db);
  return strcmp(why, "ok") == 0;
}

int catalogue_integrity(catalogue *cat) {
  char why[256];
  return check_with(cat, "PRAGMA integrity_check(1)", why, sizeof why);
}

int catalogue_quick_check(catalogue *cat, char *why, size_t size) {
  return check_with(cat, "PRAGMA quick_check(1)", why, size);
}
