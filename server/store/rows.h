/* Reading rows, shared by the files with the SQL of a kind of row (list in catalogue.h). */
#ifndef ORB_STORE_ROWS_H
#define ORB_STORE_ROWS_H

#include <stdio.h>
#include <string.h>

#include "log.h"
#include "store/catalogue.h"
#include "store/transactions.h"

/* These run inside a transaction of the writer. */
int event_insert(database *db, const char *job, int64_t number, const char *type, const char *json);
/* Keeps an existing row. *fresh: whether there was none; NULL: the caller does not ask. */
int resource_insert(database *db, const resource *r, int *fresh);
int resource_remove(database *db, resource_kind kind, const char *id);      /* SQL_NOTFOUND: no such row */
int job_insert(database *db, job_row *row, const struct job_webhook *hook); /* sets row->seq; hook NULL: none */

/* The secret of a catalogue; SQL_ERROR also if it is damaged. */
int resource_secret(database *db, unsigned char out[CATALOGUE_SECRET]);

/* read fills one row and returns 0 if out of memory; release frees a row, also one that was filled in part (NULL: a row
 * owns no memory). */
typedef struct row_kind {
  int (*read)(sql_statement *st, void *out);
  void (*release)(void *row);
  size_t size;
} row_kind;
/* The description that a list shows. A description of landmarks ends with the landmarks, which a list omits. */
#define ROW_SUMMARY(kind, json) \
  "iif(" kind "=3, substr(" json ", 1, instr(" json ", ',\"landmarks\":')-1)||'}', " json ")"
/* The columns of a job, but its request, which may be large. */
#define JOB_COLUMNS JOB_COLUMNS_WITH("state")
/* The state that callers see where several nodes share the jobs. A job that waits for others is running once one of
 * them runs. A job that a node has claimed only to find out what it must wait for is still queued. */
#define JOB_STATE_SHOWN \
  "CASE WHEN state=0 AND waits>0 AND started>0 THEN 1 WHEN state=1 AND started=0 THEN 0 ELSE state END"
#define JOB_COLUMNS_SHOWN JOB_COLUMNS_WITH(JOB_STATE_SHOWN)
#define JOB_COLUMNS_WITH(state)                                                          \
  "seq, id, key, kind, " state                                                           \
  ", attempt, crashes, suspect, alone, listed, priority, cost, owner, problem, created," \
  " started, finished, charged, result, trace, request_bytes"
extern const row_kind job_rows;
extern const row_kind resource_rows; /* columns: seq, kind, id, sha, json, bytes, created,
                                      * places, quantized, meshopt */

/* These run a bound query on a reader from catalogue_reader() (st NULL: it could not be prepared) and release the
 * reader. */
store_result rows_one(catalogue *cat, database *db, sql_statement *st, const row_kind *kind, void *out);
/* The number of rows filled, or −1, and no rows, if one of them could not be read. */
int rows_many(catalogue *cat, database *db, sql_statement *st, const row_kind *kind, void *out, int limit);
/* All rows, allocated with malloc(); NULL with *count −1 if one of them could not be read. */
void *rows_all(catalogue *cat, database *db, sql_statement *st, const row_kind *kind, int *count);
/* The integer in the query's only row; −1 if it cannot be read. */
int64_t rows_integer(catalogue *cat, database *db, sql_statement *st);

/* Gives a row another secret by an UPDATE of ?1 name, ?2 secret and ?3 until when the old one is valid.
 * STORE_NOT_FOUND: no row has the name. */
store_result rows_rotate(catalogue *cat, const char *sql, const char *name, const char *secret, int64_t old_until);

static inline void row_text(sql_statement *st, int column, char *out, size_t size) {
  const char *text = sql_text(st, column);
  snprintf(out, size, "%s", text ? text : "");
}

/* A copy allocated with malloc(); NULL for SQL NULL and if out of memory, which row_lacks() distinguishes. */
static inline char *row_copy(sql_statement *st, int column) {
  const char *text = sql_text(st, column);
  return text ? strdup(text) : NULL;
}
static inline int row_lacks(sql_statement *st, int column, const char *copy) {
  return !copy && !sql_is_null(st, column);
}

#endif
