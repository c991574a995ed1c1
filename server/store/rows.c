#include "store/rows.h"

store_result rows_one(catalogue *cat, database *db, sqlite3_stmt *st, row_reader read, void *out) {
  store_result result = STORE_ERROR;
  if (st) {
    int code = sqlite3_step(st);
    result = code == SQLITE_ROW    ? (read(st, out) ? STORE_OK : STORE_ERROR)
             : code == SQLITE_DONE ? STORE_NOT_FOUND
                                   : STORE_ERROR;
    sqlite3_reset(st);
  }
  catalogue_reader_done(cat, db);
  return result;
}

int rows_many(catalogue *cat, database *db, sqlite3_stmt *st, row_reader read, void *out, size_t size, int limit) {
  int count = 0;
  while (st && count < limit && sqlite3_step(st) == SQLITE_ROW && read(st, (char *)out + (size_t)count * size)) {
    count++;
  }
  if (st) {
    sqlite3_reset(st);
  }
  catalogue_reader_done(cat, db);
  return count;
}
