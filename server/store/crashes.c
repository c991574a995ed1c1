#include "store/crashes.h"

#include <stdlib.h>
#include <string.h>

#include "store/rows.h"
#include "store/transactions.h"

int crash_note(database *db, const char *key, const char *request, const char *tenant, int64_t now) {
  sqlite3_stmt *st = database_statement(
      db,
      "INSERT INTO crash(key, mesh, tenant, count, last) VALUES(?1, iif(json_valid(?2), coalesce(?2->>'$.mesh',"
      " ?2->>'$.shapes[0].mesh', ''), ?1), ?3, 1, ?4) ON CONFLICT(key) DO UPDATE SET count=count+1, last=?4, "
      "tenant=?3");
  if (!st) {
    return SQLITE_ERROR;
  }
  sqlite3_bind_text(st, 1, key, -1, SQLITE_STATIC);
  sqlite3_bind_text(st, 2, request ? request : "", -1, SQLITE_STATIC);
  sqlite3_bind_text(st, 3, tenant, -1, SQLITE_STATIC);
  sqlite3_bind_int64(st, 4, now);
  return database_run(db, st);
}

static sqlite3_stmt *refused(database *db, const char *key) {
  sqlite3_stmt *st = database_statement(db, "SELECT count(*) FROM crash WHERE key=?1 AND count>=?2");
  if (st) {
    sqlite3_bind_text(st, 1, key, -1, SQLITE_STATIC);
    sqlite3_bind_int(st, 2, CRASHES_MOST);
  }
  return st;
}

int crash_check(database *db, const char *key) {
  sqlite3_stmt *st = refused(db, key);
  if (!st) {
    return SQLITE_ERROR;
  }
  int code = sqlite3_step(st), count = code == SQLITE_ROW ? sqlite3_column_int(st, 0) : 0;
  sqlite3_reset(st);
  return code != SQLITE_ROW ? code : count ? SQLITE_CONSTRAINT : SQLITE_OK;
}

int catalogue_crashed(catalogue *cat, const char *key) {
  database *db = catalogue_reader(cat);
  return rows_integer(cat, db, refused(db, key)) > 0;
}

typedef struct mesh_crash {
  char mesh[API_ID_SIZE], tenant[64];
  int64_t now;
} mesh_crash;

static int note_mesh(database *db, void *arg) {
  const mesh_crash *c = arg;
  return crash_note(db, c->mesh, NULL, c->tenant, c->now);
}

void catalogue_crash_of_mesh(catalogue *cat, const char *mesh, const char *tenant, int64_t now) {
  mesh_crash *c = calloc(1, sizeof *c);
  if (c) {
    strncpy(c->mesh, mesh, sizeof c->mesh - 1);
    strncpy(c->tenant, tenant, sizeof c->tenant - 1);
    c->now = now;
    catalogue_write_later(cat, note_mesh, c);
  }
}

static int clear(database *db, void *arg) {
  sqlite3_stmt *st = database_statement(
      db, "DELETE FROM crash WHERE tenant=?1 OR substr(key, 1, length(?1))=?1 OR substr(mesh, 1, length(?1))=?1");
  if (!st) {
    return SQLITE_ERROR;
  }
  sqlite3_bind_text(st, 1, arg, -1, SQLITE_STATIC);
  int code = database_run(db, st);
  return code == SQLITE_OK && sqlite3_changes(db->handle) == 0 ? SQLITE_NOTFOUND : code;
}

store_result catalogue_crash_clear(catalogue *cat, const char *name) {
  return catalogue_write(cat, clear, (void *)(uintptr_t)name);
}

int catalogue_crash_list(catalogue *cat, api_text *out) {
  database *db = catalogue_reader(cat);
  sqlite3_stmt *st = database_statement(db,
                                        "SELECT key, count, mesh, tenant, strftime('%Y-%m-%dT%H:%M:%SZ', last/1000,"
                                        " 'unixepoch') FROM crash ORDER BY last DESC LIMIT 1000");
  int code = st ? SQLITE_ROW : SQLITE_ERROR, count = 0;
  while (st && (code = sqlite3_step(st)) == SQLITE_ROW) {
    api_text_printf(out, "%s crashes=%d%s mesh=%s tenant=%s last=%s\n", sqlite3_column_text(st, 0),
                    sqlite3_column_int(st, 1), sqlite3_column_int(st, 1) >= CRASHES_MOST ? " refused" : "",
                    sqlite3_column_text(st, 2), sqlite3_column_text(st, 3), sqlite3_column_text(st, 4));
    count++;
  }
  if (st) {
    sqlite3_reset(st);
  }
  catalogue_reader_done(cat, db);
  return code == SQLITE_DONE ? count : -1;
}
