#include "store/keys.h"

#include <stdlib.h>
#include <string.h>

#include "store/rows.h"

static int add_row(database *db, void *arg) {
  const key_row *row = arg;
  sql_statement *st = database_statement(db,
                                         "INSERT INTO signing_key(name, tenant, secret, origins, requests, cpu_seconds,"
                                         " created) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7) ON CONFLICT DO NOTHING");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, row->name);
  sql_bind_text(st, 2, row->tenant);
  sql_bind_text(st, 3, row->secret);
  sql_bind_text(st, 4, row->origins);
  sql_bind_integer(st, 5, row->requests);
  sql_bind_integer(st, 6, row->cpu_seconds);
  sql_bind_integer(st, 7, row->created);
  int code = database_run(db, st);
  return code == SQL_OK && sql_changes(db) == 0 ? SQL_CONSTRAINT : code;
}

store_result catalogue_key_add(catalogue *cat, const key_row *row) {
  return catalogue_write(cat, add_row, (void *)(uintptr_t)row);
}

store_result catalogue_key_rotate(catalogue *cat, const char *name, const char *secret, int64_t old_until) {
  return rows_rotate(cat, "UPDATE signing_key SET old_secret=secret, old_until=?3, secret=?2 WHERE name=?1", name,
                     secret, old_until);
}

static int remove_row(database *db, void *arg) {
  sql_statement *st = database_statement(db, "DELETE FROM signing_key WHERE name=?1");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, arg);
  int code = database_run(db, st);
  return code == SQL_OK && sql_changes(db) == 0 ? SQL_NOTFOUND : code;
}

store_result catalogue_key_remove(catalogue *cat, const char *name) {
  return catalogue_write(cat, remove_row, (void *)(uintptr_t)name);
}

static int read_row(sql_statement *st, void *out) {
  key_row *row = out;
  row_text(st, 0, row->name, sizeof row->name);
  row_text(st, 1, row->tenant, sizeof row->tenant);
  row_text(st, 2, row->secret, sizeof row->secret);
  row_text(st, 3, row->old_secret, sizeof row->old_secret);
  row->old_until = sql_integer(st, 4);
  row_text(st, 5, row->origins, sizeof row->origins);
  row->requests = sql_integer(st, 6);
  row->cpu_seconds = sql_integer(st, 7);
  row->created = sql_integer(st, 8);
  row->day = sql_integer(st, 9);
  row->used_requests = sql_integer(st, 10);
  row->used_ms = sql_integer(st, 11);
  return 1;
}

key_row *catalogue_keys(catalogue *cat, int *count) {
  static const row_kind kind = {.read = read_row, .size = sizeof(key_row)};
  database *db = catalogue_reader(cat);
  sql_statement *st =
      database_statement(db,
                         "SELECT name, tenant, secret, old_secret, old_until, origins, requests, cpu_seconds,"
                         " created, day, used_requests, used_ms FROM signing_key ORDER BY name");
  return rows_all(cat, db, st, &kind, count);
}

typedef struct use_arg {
  char name[KEY_NAME];
  int64_t day, requests, ms;
} use_arg;

static int add_use(database *db, void *arg) {
  const use_arg *u = arg;
  sql_statement *st = database_statement(db,
                                         "UPDATE signing_key SET used_requests=iif(day=?2, used_requests, 0)+?3,"
                                         " used_ms=iif(day=?2, used_ms, 0)+?4, day=?2 WHERE name=?1 AND day<=?2");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, u->name);
  sql_bind_integer(st, 2, u->day);
  sql_bind_integer(st, 3, u->requests);
  sql_bind_integer(st, 4, u->ms);
  return database_run(db, st);
}

void catalogue_key_use(catalogue *cat, const char *name, int64_t day, int64_t requests, int64_t ms) {
  use_arg *u = calloc(1, sizeof *u);
  if (u) {
    snprintf(u->name, sizeof u->name, "%s", name);
    u->day = day;
    u->requests = requests;
    u->ms = ms;
    catalogue_write_later(cat, add_use, u);
  }
}

static int nothing(database *db, void *arg) {
  (void)db;
  (void)arg;
  return SQL_OK;
}

void catalogue_key_settle(catalogue *cat) {
  (void)catalogue_write(cat, nothing, NULL); /* the writer keeps the order of writes */
}

int64_t catalogue_key_ms(catalogue *cat, const char *name, int64_t day) {
  database *db = catalogue_reader(cat);
  sql_statement *st =
      database_statement(db, "SELECT coalesce((SELECT used_ms FROM signing_key WHERE name=?1 AND day=?2), 0)");
  if (st) {
    sql_bind_text(st, 1, name);
    sql_bind_integer(st, 2, day);
  }
  return rows_integer(cat, db, st);
}
