/* Shared by the files that read and write rows. */
#ifndef ORB_STORE_ROWS_H
#define ORB_STORE_ROWS_H

#include <stdio.h>
#include <string.h>

#include "log.h"
#include "store/database.h"

/* Inside a transaction; keeps a row that is there. */
int resource_insert(database *db, const resource *r);
int resource_remove(database *db, resource_kind kind, const char *id); /* SQLITE_NOTFOUND: it was not there */

/* read fills one row and says 0 where memory is out; release frees what it filled, all of it or a part. */
typedef struct row_kind {
  int (*read)(sqlite3_stmt *st, void *out);
  void (*release)(void *row);
  size_t size;
} row_kind;
extern const row_kind resource_rows; /* of seq, kind, id, sha, json, bytes, created, places */

/* Runs a bound query of a reader that catalogue_reader() gave (st NULL: it could not be prepared) and gives the reader
 * back. */
store_result rows_one(catalogue *cat, database *db, sqlite3_stmt *st, const row_kind *kind, void *out);
/* The number filled, −1 where not all that there are could be read. */
int rows_many(catalogue *cat, database *db, sqlite3_stmt *st, const row_kind *kind, void *out, int limit);
/* The integer that the query's one row is, −1 where it cannot be read. */
int64_t rows_integer(catalogue *cat, database *db, sqlite3_stmt *st);

static inline void row_text(sqlite3_stmt *st, int column, char *out, size_t size) {
  const unsigned char *text = sqlite3_column_text(st, column);
  snprintf(out, size, "%s", text ? (const char *)text : "");
}

/* In memory of malloc(); NULL for NULL or when memory is out: row_lacks() tells. */
static inline char *row_copy(sqlite3_stmt *st, int column) {
  const unsigned char *text = sqlite3_column_text(st, column);
  return text ? strdup((const char *)text) : NULL;
}
static inline int row_lacks(sqlite3_stmt *st, int column, const char *copy) {
  return !copy && sqlite3_column_type(st, column) != SQLITE_NULL;
}

#endif
