#include "store/move_mark.h"

#include <stdio.h>
#include <string.h>

static int text_of(database *db, const char *sql, char out[MOVE_MARK]) {
  sql_statement *st = database_statement(db, sql);
  int code = st ? sql_step(st) : SQL_ERROR;
  out[0] = 0;
  if (code == SQL_ROW) {
    const char *text = sql_text(st, 0);
    snprintf(out, MOVE_MARK, "%s", text ? text : "");
  }
  sql_reset(st);
  return code == SQL_ROW || code == SQL_DONE ? SQL_OK : code;
}

int move_mark_read(database *db, char out[MOVE_MARK]) {
  int code = text_of(db,
                     database_either(db, "SELECT name FROM sqlite_master WHERE type='table' AND name='migrating'",
                                     "SELECT 'migrating' WHERE to_regclass('migrating') IS NOT NULL"),
                     out);
  return code == SQL_OK && out[0] ? text_of(db, "SELECT source FROM migrating", out) : code;
}

int move_mark_set(database *db, const char *mark) {
  char sql[256];
  snprintf(sql, sizeof sql, "CREATE TABLE migrating(source TEXT NOT NULL); INSERT INTO migrating(source) VALUES('%s')",
           mark);
  int code = database_execute(db, "BEGIN");
  code = code == SQL_OK ? database_execute(db, sql) : code;
  code = code == SQL_OK ? database_execute(db, "COMMIT") : code;
  if (code != SQL_OK && sql_in_transaction(db)) {
    database_execute(db, "ROLLBACK");
  }
  return code;
}

int move_mark_clear(database *db) {
  return database_execute(db, "DROP TABLE migrating");
}
