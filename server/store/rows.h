/* Shared by the files that read and write rows. */
#ifndef ORB_STORE_ROWS_H
#define ORB_STORE_ROWS_H

#include <stdio.h>
#include <string.h>

#include "store/database.h"

/* Inside a transaction; keeps a row that is there. */
int resource_insert(database *db, const resource *r);

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
