/* Rows of the events of jobs. */
#include <stdlib.h>

#include "store/rows.h"

int event_insert(database *db, const char *job, int64_t number, const char *type, const char *json) {
  sql_statement *st =
      database_statement(db,
                         "INSERT INTO event(job, number, type, json) VALUES(?1,?2,?3,?4)"
                         " ON CONFLICT(job, number) DO UPDATE SET type=excluded.type, json=excluded.json");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, job);
  sql_bind_integer(st, 2, number);
  sql_bind_text(st, 3, type);
  sql_bind_text(st, 4, json);
  return database_run(db, st);
}

typedef struct event_arg {
  char job[API_JOB_ID_SIZE], type[16];
  int64_t number;
  char json[];
} event_arg;

static int put_event(database *db, void *arg) {
  const event_arg *e = arg;
  return event_insert(db, e->job, e->number, e->type, e->json);
}

void catalogue_event(catalogue *cat, const char *job, int64_t number, const char *type, const char *json) {
  size_t size = strlen(json) + 1;
  event_arg *e = calloc(1, sizeof *e + size);
  if (e) {
    snprintf(e->job, sizeof e->job, "%s", job);
    snprintf(e->type, sizeof e->type, "%s", type);
    e->number = number;
    memcpy(e->json, json, size);
    catalogue_write_gathered(cat, put_event, e);
  }
}

static int read_event(sql_statement *st, void *to) {
  event_row *out = to;
  out->number = sql_integer(st, 0);
  row_text(st, 1, out->type, sizeof out->type);
  out->json = row_copy(st, 2);
  return out->json != NULL;
}
static void release_event(void *row) {
  free(((event_row *)row)->json);
}
static const row_kind event_rows = {read_event, release_event, sizeof(event_row)};

int catalogue_events(catalogue *cat, const char *job, int64_t after, int limit, event_row *out) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(
      db, "SELECT number, type, json FROM event WHERE job=?1 AND number>?2 ORDER BY number LIMIT ?3");
  if (st) {
    sql_bind_text(st, 1, job);
    sql_bind_integer(st, 2, after);
    sql_bind_integer(st, 3, limit);
  }
  return rows_many(cat, db, st, &event_rows, out, limit);
}
