/* Shared by the files that read and write rows. */
#ifndef ORB_STORE_ROWS_H
#define ORB_STORE_ROWS_H

#include <stdio.h>
#include <string.h>

#include "store/database.h"

/* Inside a transaction; keeps a row that is there. */
int resource_insert(database *db, const resource *r);

/* Runs a bound query of a reader that catalogue_reader() gave (st NULL: it could not be prepared) and gives the reader
 * back. read fills one row and says 0 where memory is out. */
typedef int (*row_reader)(sqlite3_stmt *st, void *out);
store_result rows_one(catalogue *cat, database *db, sqlite3_stmt *st, row_reader read, void *out);
/* The number filled; size: of one. */
int rows_many(catalogue *cat, database *db, sqlite3_stmt *st, row_reader read, void *out, size_t size, int limit);

static inline void row_text(sqlite3_stmt *st, int column, char *out, size_t size) {
  const unsigned char *text = sqlite3_column_text(st, column);
  snprintf(out, size, "%s", text ? (const char *)text : "");
}

/* In memory of malloc(); NULL for NULL or when memory is out. */
static inline char *row_copy(sqlite3_stmt *st, int column) {
  const unsigned char *text = sqlite3_column_text(st, column);
  return text ? strdup((const char *)text) : NULL;
}

#endif
