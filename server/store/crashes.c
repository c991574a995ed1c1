#include "store/crashes.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "store/rows.h"
#include "store/transactions.h"

/* mesh: of an embedding; meshes: of a supermesh, separated by commas. */
#define NOTE(mesh, meshes)                                                                                    \
  "INSERT INTO crash(key, mesh, tenant, count, last) VALUES(?1, CASE WHEN json_valid(?2) THEN coalesce(" mesh \
  ", " meshes ", '') ELSE ?1 END, ?3, 1, ?4) ON CONFLICT(key, tenant) DO UPDATE SET count=crash.count+1, last=?4"

int crash_note(database *db, const char *key, const char *request, const char *tenant, int64_t now) {
  sql_statement *st = database_statement(db, database_either(db,
                                                             NOTE("?2->>'$.mesh'",
                                                                  "(SELECT group_concat(DISTINCT value->>'$.mesh')"
                                                                  " FROM json_each(?2, '$.shapes'))"),
                                                             NOTE("?2::json->>'mesh'",
                                                                  "(SELECT string_agg(DISTINCT s->>'mesh', ',')"
                                                                  " FROM json_array_elements(?2::json->'shapes') s)")));
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, key);
  sql_bind_text(st, 2, request ? request : "");
  sql_bind_text(st, 3, tenant);
  sql_bind_integer(st, 4, now);
  return database_run(db, st);
}

static sql_statement *refused(database *db, const char *key) {
  sql_statement *st = database_statement(
      db, "SELECT count(*) FROM (SELECT key FROM crash WHERE key=?1 GROUP BY key HAVING sum(count)>=?2) AS many");
  if (st) {
    sql_bind_text(st, 1, key);
    sql_bind_integer(st, 2, CRASHES_MOST);
  }
  return st;
}

int crash_check(database *db, const char *key) {
  sql_statement *st = refused(db, key);
  if (!st) {
    return SQL_ERROR;
  }
  int code = sql_step(st), count = code == SQL_ROW ? sql_int(st, 0) : 0;
  sql_reset(st);
  return code != SQL_ROW ? code : count ? SQL_CONSTRAINT : SQL_OK;
}

int catalogue_crashed(catalogue *cat, const char *key) {
  database *db = catalogue_reader(cat);
  return rows_integer(cat, db, refused(db, key)) > 0;
}

typedef struct other_crash {
  char key[API_ID_SIZE], tenant[64];
  char request[API_ID_SIZE + 16]; /* "": the key is a mesh's */
  int64_t now;
} other_crash;

static int note_other(database *db, void *arg) {
  const other_crash *c = arg;
  return crash_note(db, c->key, c->request[0] ? c->request : NULL, c->tenant, c->now);
}

void catalogue_crash_of(catalogue *cat, const char *key, const char *result, const char *tenant, int64_t now) {
  other_crash *c = calloc(1, sizeof *c);
  if (c) {
    strncpy(c->key, key, sizeof c->key - 1);
    strncpy(c->tenant, tenant, sizeof c->tenant - 1);
    if (result) {
      snprintf(c->request, sizeof c->request, "{\"mesh\":\"%s\"}", result);
    }
    c->now = now;
    catalogue_write_later(cat, note_other, c);
  }
}

void catalogue_crash_of_mesh(catalogue *cat, const char *mesh, const char *tenant, int64_t now) {
  catalogue_crash_of(cat, mesh, NULL, tenant, now);
}

/* find: the function that finds a text in another one. A name may be the beginning of any mesh. */
#define CLEAR(find) \
  "DELETE FROM crash WHERE tenant=?1 OR substr(key, 1, length(?1))=?1 OR " find "(',' || mesh, ',' || ?1)>0"

static int clear(database *db, void *arg) {
  sql_statement *st = database_statement(db, database_either(db, CLEAR("instr"), CLEAR("strpos")));
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, arg);
  int code = database_run(db, st);
  return code == SQL_OK && sql_changes(db) == 0 ? SQL_NOTFOUND : code;
}

store_result catalogue_crash_clear(catalogue *cat, const char *name) {
  return catalogue_write(cat, clear, (void *)(uintptr_t)name);
}

int catalogue_crash_list(catalogue *cat, api_text *out) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(db,
                                         "SELECT key, count, mesh, tenant, strftime('%Y-%m-%dT%H:%M:%SZ', last/1000,"
                                         " 'unixepoch'), (SELECT sum(o.count) FROM crash o WHERE o.key=c.key)"
                                         " FROM crash c ORDER BY last DESC, key, tenant LIMIT 1000");
  int code = st ? SQL_ROW : SQL_ERROR, count = 0;
  while (st && (code = sql_step(st)) == SQL_ROW) {
    api_text_printf(out, "%s crashes=%d%s mesh=%s tenant=%s last=%s\n", sql_text(st, 0), sql_int(st, 1),
                    sql_int(st, 5) >= CRASHES_MOST ? " refused" : "", sql_text(st, 2), sql_text(st, 3),
                    sql_text(st, 4));
    count++;
  }
  if (st) {
    sql_reset(st);
  }
  catalogue_reader_done(cat, db);
  return code == SQL_DONE ? count : -1;
}
