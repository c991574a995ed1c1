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
  return database_run_later(db, st, SQL_ANY);
}

/* Events that wait to be written together. */
typedef struct event_arg {
  struct event_arg *next, *newest; /* newest: of the first one */
  int count;                       /* of the first one */
  char job[API_JOB_ID_SIZE], type[16];
  int64_t number;
  char json[];
} event_arg;

enum { TOGETHER = 32 };

static void release_events(void *arg) {
  for (event_arg *e = arg, *next; e; e = next) {
    next = e->next;
    free(e);
  }
}

static int join_event(void *waiting, void *arg) {
  event_arg *first = waiting, *fresh = arg;
  int fits = first->count < TOGETHER;
  for (const event_arg *e = first; e && fits; e = e->next) { /* a statement cannot write a row twice */
    fits = e->number != fresh->number || strcmp(e->job, fresh->job) != 0;
  }
  if (!fits) {
    return 0;
  }
  first->newest->next = fresh;
  first->newest = fresh;
  first->count++;
  return 1;
}

/* A text of an array in PostgreSQL. */
static void add_quoted(api_text *out, const char *text) {
  api_text_add(out, "\"");
  for (size_t n; *text; text += n) {
    n = strcspn(text, "\"\\");
    api_text_printf(out, "%.*s", (int)n, text);
    if (text[n]) {
      api_text_printf(out, "\\%c", text[n++]);
    }
  }
  api_text_add(out, "\"");
}

/* In PostgreSQL, one statement writes them all. */
static int put_at_once(database *db, const event_arg *first) {
  api_text jobs = {0}, numbers = {0}, types = {0}, jsons = {0};
  for (const event_arg *e = first; e; e = e->next) {
    const char *mark = e == first ? "{" : ",";
    api_text_printf(&jobs, "%s%s", mark, e->job);
    api_text_printf(&numbers, "%s%lld", mark, (long long)e->number);
    api_text_printf(&types, "%s%s", mark, e->type);
    api_text_add(&jsons, mark);
    add_quoted(&jsons, e->json);
  }
  api_text *const all[] = {&jobs, &numbers, &types, &jsons};
  int failed = 0;
  for (int i = 0; i < 4; i++) {
    api_text_add(all[i], "}");
    failed |= all[i]->failed;
  }
  sql_statement *st = failed
                          ? NULL
                          : database_statement(db,
                                               "INSERT INTO event(job, number, type, json)"
                                               " SELECT * FROM unnest(?1::text[], ?2::bigint[], ?3::text[], ?4::text[])"
                                               " ON CONFLICT(job, number)"
                                               " DO UPDATE SET type=excluded.type, json=excluded.json");
  for (int i = 0; st && i < 4; i++) {
    sql_bind_text(st, i + 1, all[i]->data);
  }
  int code = failed ? SQL_NOMEM : database_run_later(db, st, SQL_ANY);
  for (int i = 0; i < 4; i++) {
    api_text_free(all[i]);
  }
  return code;
}

static int put_events(database *db, void *arg) {
  const event_arg *first = arg;
  if (first->next && db->connection.driver == &sql_postgresql) {
    return put_at_once(db, first);
  }
  int code = SQL_OK;
  for (const event_arg *e = first; e && code == SQL_OK; e = e->next) {
    code = event_insert(db, e->job, e->number, e->type, e->json);
  }
  return code;
}

void catalogue_event(catalogue *cat, const char *job, int64_t number, const char *type, const char *json) {
  size_t size = strlen(json) + 1;
  event_arg *e = calloc(1, sizeof *e + size);
  if (e) {
    e->newest = e;
    e->count = 1;
    snprintf(e->job, sizeof e->job, "%s", job);
    snprintf(e->type, sizeof e->type, "%s", type);
    e->number = number;
    memcpy(e->json, json, size);
    catalogue_write_joined(cat, put_events, e, join_event, release_events);
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
