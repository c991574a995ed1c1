#include "store/rows.h"

#include <stdlib.h>

static void release(const row_kind *kind, void *row) {
  if (kind->release) {
    kind->release(row);
  }
}

/* SQLite returns NULL for a text that it has no memory to convert; only its error code distinguishes that from SQL
 * NULL. */
static int fill(database *db, sqlite3_stmt *st, const row_kind *kind, void *out) {
  if (kind->read(st, out) && (sqlite3_errcode(db->handle) & 0xff) != SQLITE_NOMEM) {
    return 1;
  }
  log_error("catalogue: out of memory for a row");
  release(kind, out);
  return 0;
}

store_result rows_one(catalogue *cat, database *db, sqlite3_stmt *st, const row_kind *kind, void *out) {
  store_result result = STORE_ERROR;
  if (st) {
    int code = sqlite3_step(st);
    result = code == SQLITE_ROW    ? (fill(db, st, kind, out) ? STORE_OK : STORE_ERROR)
             : code == SQLITE_DONE ? STORE_NOT_FOUND
                                   : STORE_ERROR;
    sqlite3_reset(st);
  }
  catalogue_reader_done(cat, db);
  return result;
}

int rows_many(catalogue *cat, database *db, sqlite3_stmt *st, const row_kind *kind, void *out, int limit) {
  int count = 0, code = st ? SQLITE_ROW : SQLITE_ERROR;
  while (count < limit && code == SQLITE_ROW && (code = sqlite3_step(st)) == SQLITE_ROW) {
    if (fill(db, st, kind, (char *)out + (size_t)count * kind->size)) {
      count++;
    } else {
      code = SQLITE_NOMEM;
    }
  }
  if (st) {
    sqlite3_reset(st);
  }
  catalogue_reader_done(cat, db);
  if (code == SQLITE_ROW || code == SQLITE_DONE) {
    return count;
  }
  log_error("catalogue: rows cannot be read: %s", sqlite3_errstr(code));
  while (count > 0) {
    release(kind, (char *)out + (size_t)--count * kind->size);
  }
  return -1;
}

void *rows_all(catalogue *cat, database *db, sqlite3_stmt *st, const row_kind *kind, int *count) {
  size_t room = 16, found = 0;
  char *rows = calloc(room, kind->size);
  int code = SQLITE_ERROR;
  while (st && rows && (code = sqlite3_step(st)) == SQLITE_ROW) {
    if (found == room) {
      char *more = found < INT32_MAX / 2 ? reallocarray(rows, 2 * room, kind->size) : NULL;
      if (!more) {
        break;
      }
      rows = more;
      room *= 2;
    }
    char *row = rows + found * kind->size;
    memset(row, 0, kind->size);
    if (!fill(db, st, kind, row)) {
      break;
    }
    found++;
  }
  if (st) {
    sqlite3_reset(st);
  }
  catalogue_reader_done(cat, db);
  if (code == SQLITE_DONE) {
    *count = (int)found;
    return rows;
  }
  while (found > 0) {
    release(kind, rows + --found * kind->size);
  }
  free(rows);
  *count = -1;
  return NULL;
}

int64_t rows_integer(catalogue *cat, database *db, sqlite3_stmt *st) {
  int64_t value = -1;
  if (st) {
    if (sqlite3_step(st) == SQLITE_ROW) {
      value = sqlite3_column_int64(st, 0);
    }
    sqlite3_reset(st);
  }
  catalogue_reader_done(cat, db);
  return value;
}

typedef struct rotation {
  const char *sql, *name, *secret;
  int64_t old_until;
} rotation;

static int rotate(database *db, void *arg) {
  const rotation *r = arg;
  sqlite3_stmt *st = database_statement(db, r->sql);
  if (!st) {
    return SQLITE_ERROR;
  }
  sqlite3_bind_text(st, 1, r->name, -1, SQLITE_STATIC);
  sqlite3_bind_text(st, 2, r->secret, -1, SQLITE_STATIC);
  sqlite3_bind_int64(st, 3, r->old_until);
  int code = database_run(db, st);
  return code == SQLITE_OK && sqlite3_changes(db->handle) == 0 ? SQLITE_NOTFOUND : code;
}

store_result rows_rotate(catalogue *cat, const char *sql, const char *name, const char *secret, int64_t old_until) {
  rotation r = {sql, name, secret, old_until};
  return catalogue_write(cat, rotate, &r);
}
