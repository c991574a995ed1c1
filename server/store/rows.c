#include "store/rows.h"

#include <stdlib.h>

static void complain(const database *db) {
  if (!sql_postgresql_is_away()) { /* which has been logged */
    log_error("catalogue: rows cannot be read: %s", db->connection.driver->message(&db->connection));
  }
}

static void release(const row_kind *kind, void *row) {
  if (kind->release) {
    kind->release(row);
  }
}

/* SQLite returns NULL for a text that it has no memory to convert; only its error code distinguishes that from SQL
 * NULL. */
static int fill(database *db, sql_statement *st, const row_kind *kind, void *out) {
  if (kind->read(st, out) && !sql_out_of_memory(db)) {
    return 1;
  }
  log_error("catalogue: out of memory for a row");
  release(kind, out);
  return 0;
}

store_result rows_one(catalogue *cat, database *db, sql_statement *st, const row_kind *kind, void *out) {
  store_result result = STORE_ERROR;
  if (st) {
    int code = sql_step(st);
    result = code == SQL_ROW    ? (fill(db, st, kind, out) ? STORE_OK : STORE_ERROR)
             : code == SQL_DONE ? STORE_NOT_FOUND
                                : STORE_ERROR;
    if (code != SQL_ROW && code != SQL_DONE) {
      complain(db);
    }
    sql_reset(st);
  }
  catalogue_reader_done(cat, db);
  return result;
}

int rows_many(catalogue *cat, database *db, sql_statement *st, const row_kind *kind, void *out, int limit) {
  int count = 0, code = st ? SQL_ROW : SQL_ERROR;
  while (count < limit && code == SQL_ROW && (code = sql_step(st)) == SQL_ROW) {
    if (fill(db, st, kind, (char *)out + (size_t)count * kind->size)) {
      count++;
    } else {
      code = SQL_NOMEM;
    }
  }
  int fine = code == SQL_ROW || code == SQL_DONE;
  if (st && !fine) {
    complain(db);
  }
  sql_reset(st);
  catalogue_reader_done(cat, db);
  if (fine) {
    return count;
  }
  while (count > 0) {
    release(kind, (char *)out + (size_t)--count * kind->size);
  }
  return -1;
}

void *rows_all(catalogue *cat, database *db, sql_statement *st, const row_kind *kind, int *count) {
  size_t room = 16, found = 0;
  char *rows = calloc(room, kind->size);
  int code = SQL_ERROR;
  while (st && rows && (code = sql_step(st)) == SQL_ROW) {
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
    sql_reset(st);
  }
  catalogue_reader_done(cat, db);
  if (code == SQL_DONE) {
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

int64_t rows_integer(catalogue *cat, database *db, sql_statement *st) {
  int64_t value = -1;
  if (st) {
    int code = sql_step(st);
    if (code == SQL_ROW) {
      value = sql_integer(st, 0);
    } else if (code != SQL_DONE) {
      complain(db);
    }
    sql_reset(st);
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
  sql_statement *st = database_statement(db, r->sql);
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, r->name);
  sql_bind_text(st, 2, r->secret);
  sql_bind_integer(st, 3, r->old_until);
  int code = database_run(db, st);
  return code == SQL_OK && sql_changes(db) == 0 ? SQL_NOTFOUND : code;
}

store_result rows_rotate(catalogue *cat, const char *sql, const char *name, const char *secret, int64_t old_until) {
  rotation r = {sql, name, secret, old_until};
  return catalogue_write(cat, rotate, &r);
}
