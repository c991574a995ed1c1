/* Rows of jobs and events. */
#include <stdlib.h>

#include "store/crashes.h"
#include "store/deliveries.h"
#include "store/owners.h"
#include "store/rows.h"
#include "store/usage.h"

#define COLUMNS                                                                                                   \
  "seq, id, key, kind, state, attempt, crashes, suspect, alone, listed, priority, cost, owner, request, problem," \
  " created, started, finished, charged, result"

void job_row_free(job_row *row) {
  free(row->request);
  free(row->problem);
  row->request = row->problem = NULL;
}

typedef struct insert_arg {
  job_row *row;
  const job_webhook *hook;
} insert_arg;

static int insert(database *db, void *arg) {
  job_row *r = ((insert_arg *)arg)->row;
  const job_webhook *hook = ((insert_arg *)arg)->hook;
  sqlite3_stmt *st = database_statement(
      db,
      "INSERT INTO job(id, key, kind, state, attempt, listed, priority, cost, owner, request, created,"
      " charged) VALUES(?1, ?2, ?3, 0, 0, ?4, ?5, ?6, ?7, ?8, ?9, ?10)");
  if (!st) {
    return SQLITE_ERROR;
  }
  sqlite3_bind_text(st, 1, r->id, -1, SQLITE_STATIC);
  sqlite3_bind_text(st, 2, r->key, -1, SQLITE_STATIC);
  sqlite3_bind_int(st, 3, (int)r->kind);
  sqlite3_bind_int(st, 4, r->listed);
  sqlite3_bind_int(st, 5, r->priority);
  sqlite3_bind_int64(st, 6, r->cost);
  sqlite3_bind_text(st, 7, r->owner, -1, SQLITE_STATIC);
  sqlite3_bind_text(st, 8, r->request, -1, SQLITE_STATIC);
  sqlite3_bind_int64(st, 9, r->created);
  sqlite3_bind_text(st, 10, r->charged, -1, SQLITE_STATIC);
  int code = crash_check(db, r->key);
  code = code == SQLITE_OK ? database_run(db, st) : code;
  r->seq = sqlite3_last_insert_rowid(db->handle);
  code = code == SQLITE_OK ? owner_of_meshes(db, r->request, r->owner, r->created, r->listed) : code;
  return code == SQLITE_OK && hook ? delivery_subscribe(db, r->id, hook) : code;
}

store_result catalogue_job_insert(catalogue *cat, job_row *row, const job_webhook *hook) {
  return catalogue_write(cat, insert, &(insert_arg){row, hook});
}

typedef struct change {
  const char *id, *problem;
  int attempt, alone, counts;
  const job_row *row;
  int64_t now;
  const job_end *end;
} change;

/* Runs an update that must change exactly one row. */
static int must_change(database *db, sqlite3_stmt *st) {
  int code = database_run(db, st);
  return code == SQLITE_OK && sqlite3_changes(db->handle) != 1 ? SQLITE_CONSTRAINT : code;
}

static int list_it(database *db, void *arg) {
  sqlite3_stmt *st = database_statement(db, "UPDATE job SET listed=1 WHERE id=?1");
  if (st) {
    sqlite3_bind_text(st, 1, arg, -1, SQLITE_STATIC);
  }
  return must_change(db, st);
}

store_result catalogue_job_list_it(catalogue *cat, const char *id) {
  return catalogue_write(cat, list_it, (void *)(uintptr_t)id);
}

static int claim(database *db, void *arg) {
  const change *c = arg;
  sqlite3_stmt *st = database_statement(db,
                                        "UPDATE job SET state=1, attempt=?2, alone=?3,"
                                        " started=CASE started WHEN 0 THEN ?4 ELSE started END"
                                        " WHERE id=?1 AND state<2 AND attempt=?2-1");
  if (st) {
    sqlite3_bind_text(st, 1, c->id, -1, SQLITE_STATIC);
    sqlite3_bind_int(st, 2, c->attempt);
    sqlite3_bind_int(st, 3, c->alone);
    sqlite3_bind_int64(st, 4, c->now);
  }
  return must_change(db, st);
}

store_result catalogue_job_claim(catalogue *cat, const char *id, int attempt, int alone, int64_t now) {
  change c = {.id = id, .attempt = attempt, .alone = alone, .now = now};
  return catalogue_write(cat, claim, &c);
}

static int release(database *db, void *arg) {
  const change *c = arg;
  sqlite3_stmt *st =
      database_statement(db, "UPDATE job SET state=0, attempt=?2-1, alone=0 WHERE id=?1 AND state=1 AND attempt=?2");
  if (st) {
    sqlite3_bind_text(st, 1, c->id, -1, SQLITE_STATIC);
    sqlite3_bind_int(st, 2, c->attempt);
  }
  return must_change(db, st);
}

store_result catalogue_job_release(catalogue *cat, const char *id, int attempt) {
  change c = {.id = id, .attempt = attempt};
  return catalogue_write(cat, release, &c);
}

static int crashed(database *db, void *arg) {
  const change *c = arg;
  sqlite3_stmt *st = database_statement(
      db, "UPDATE job SET state=0, alone=0, crashes=crashes+?3, suspect=?4 WHERE id=?1 AND state=1 AND attempt=?2");
  if (st) {
    sqlite3_bind_text(st, 1, c->id, -1, SQLITE_STATIC);
    sqlite3_bind_int(st, 2, c->attempt);
    sqlite3_bind_int(st, 3, c->counts);
    sqlite3_bind_int(st, 4, c->alone);
  }
  int code = must_change(db, st);
  return code == SQLITE_OK && c->counts ? crash_note(db, c->row->key, c->row->request, c->row->owner, c->now) : code;
}

store_result catalogue_job_crashed(catalogue *cat, const job_row *row, int counts, int suspect, int64_t now) {
  change c = {.id = row->id, .attempt = row->attempt, .counts = counts, .alone = suspect, .row = row, .now = now};
  return catalogue_write(cat, crashed, &c);
}

static int write_event(database *db, const char *job, int64_t number, const char *type, const char *json) {
  sqlite3_stmt *st =
      database_statement(db, "INSERT OR REPLACE INTO event(job, number, type, json) VALUES(?1,?2,?3,?4)");
  if (!st) {
    return SQLITE_ERROR;
  }
  sqlite3_bind_text(st, 1, job, -1, SQLITE_STATIC);
  sqlite3_bind_int64(st, 2, number);
  sqlite3_bind_text(st, 3, type, -1, SQLITE_STATIC);
  sqlite3_bind_text(st, 4, json, -1, SQLITE_STATIC);
  return database_run(db, st);
}

static int finish(database *db, void *arg) {
  const change *c = arg;
  const job_end *end = c->end;
  sqlite3_stmt *st = database_statement(db,
                                        "UPDATE job SET state=?3, problem=?4, finished=?5, suspect=0, alone=0,"
                                        " result=?6 WHERE id=?1 AND attempt=?2 AND state<2");
  if (st) {
    sqlite3_bind_text(st, 1, c->id, -1, SQLITE_STATIC);
    sqlite3_bind_int(st, 2, c->attempt);
    sqlite3_bind_int(st, 3, (int)end->state);
    sqlite3_bind_text(st, 4, end->problem, -1, SQLITE_STATIC);
    sqlite3_bind_int64(st, 5, end->now);
    sqlite3_bind_text(st, 6, end->mesh ? end->mesh : "", -1, SQLITE_STATIC);
  }
  int code = must_change(db, st);
  if (code == SQLITE_OK && end->result) {
    code = resource_insert(db, end->result);
  }
  if (code == SQLITE_OK && end->state == API_JOB_SUCCEEDED && !end->mesh) {
    code = owner_of_job(db, c->id, end->now);
  }
  if (code == SQLITE_OK && end->worker_ms > 0) {
    code = usage_add_time(db, end->owner, end->worker_ms);
  }
  if (code == SQLITE_OK && end->event_json) {
    code = write_event(db, c->id, end->event, api_job_state_name(end->state), end->event_json);
  }
  if (code == SQLITE_OK && end->event_json) {
    code = delivery_announce(db, c->id, end->state, end->event_json, end->now);
  }
  return code;
}

store_result catalogue_job_finish(catalogue *cat, const char *id, int attempt, const job_end *end) {
  change c = {.id = id, .attempt = attempt, .end = end};
  return catalogue_write(cat, finish, &c);
}

static int read_row(sqlite3_stmt *st, void *to) {
  job_row *out = to;
  memset(out, 0, sizeof *out);
  out->seq = sqlite3_column_int64(st, 0);
  row_text(st, 1, out->id, sizeof out->id);
  row_text(st, 2, out->key, sizeof out->key);
  out->kind = (api_job_kind)sqlite3_column_int(st, 3);
  out->state = (api_job_state)sqlite3_column_int(st, 4);
  out->attempt = sqlite3_column_int(st, 5);
  out->crashes = sqlite3_column_int(st, 6);
  out->suspect = sqlite3_column_int(st, 7);
  out->alone = sqlite3_column_int(st, 8);
  out->listed = sqlite3_column_int(st, 9);
  out->priority = sqlite3_column_int(st, 10);
  out->cost = sqlite3_column_int64(st, 11);
  row_text(st, 12, out->owner, sizeof out->owner);
  out->request = row_copy(st, 13);
  out->problem = row_copy(st, 14);
  out->created = sqlite3_column_int64(st, 15);
  out->started = sqlite3_column_int64(st, 16);
  out->finished = sqlite3_column_int64(st, 17);
  row_text(st, 18, out->charged, sizeof out->charged);
  row_text(st, 19, out->result, sizeof out->result);
  return out->request != NULL && !row_lacks(st, 14, out->problem);
}
static void release_row(void *row) {
  job_row_free(row);
}
static const row_kind job_rows = {read_row, release_row, sizeof(job_row)};

store_result catalogue_job_get(catalogue *cat, const char *id, job_row *out) {
  database *db = catalogue_reader(cat);
  sqlite3_stmt *st = database_statement(db, "SELECT " COLUMNS " FROM job WHERE id=?1");
  if (st) {
    sqlite3_bind_text(st, 1, id, -1, SQLITE_STATIC);
  }
  return rows_one(cat, db, st, &job_rows, out);
}

/* Listed jobs of state ?1 (−1: any, −2: queued or running) with a sequence number below ?2. */
#define LISTED " FROM job WHERE listed=1 AND (?1=-1 OR state=?1 OR (?1=-2 AND state<2)) AND "
/* Those whose id begins with ?5, through the index of ids; a "+" keeps SQLite from using another index. */
#define NAMED "id>=?5 AND id<?5 || 'g' AND +seq<?2"

int catalogue_job_list(catalogue *cat, const char *owner, const char *prefix, int state, int64_t before, int limit,
                       job_row *out) {
  static const char *const queries[2][2] = {
      {"SELECT " COLUMNS LISTED "seq<?2 ORDER BY seq DESC LIMIT ?3",
       "SELECT " COLUMNS LISTED "seq<?2 AND owner=?4 ORDER BY seq DESC LIMIT ?3"},
      {"SELECT " COLUMNS LISTED NAMED " ORDER BY +seq DESC LIMIT ?3",
       "SELECT " COLUMNS LISTED NAMED " AND +owner=?4 ORDER BY +seq DESC LIMIT ?3"}};
  database *db = catalogue_reader(cat);
  sqlite3_stmt *st = database_statement(db, queries[prefix != NULL][owner != NULL]);
  if (st && owner) {
    sqlite3_bind_text(st, 4, owner, -1, SQLITE_STATIC);
  }
  if (st && prefix) {
    sqlite3_bind_text(st, 5, prefix, -1, SQLITE_STATIC);
  }
  if (st) {
    sqlite3_bind_int(st, 1, state);
    sqlite3_bind_int64(st, 2, before > 0 ? before : INT64_MAX);
    sqlite3_bind_int(st, 3, limit);
  }
  return rows_many(cat, db, st, &job_rows, out, limit);
}

int catalogue_unfinished(catalogue *cat, int64_t after, int limit, job_row *out) {
  database *db = catalogue_reader(cat);
  sqlite3_stmt *st =
      database_statement(db, "SELECT " COLUMNS " FROM job WHERE state<2 AND seq>?1 ORDER BY seq LIMIT ?2");
  if (st) {
    sqlite3_bind_int64(st, 1, after);
    sqlite3_bind_int(st, 2, limit);
  }
  return rows_many(cat, db, st, &job_rows, out, limit);
}

/* Fails a job that crashed alone too often, and writes its final event for clients that follow it. */
static int give_up(database *db, job_row *row, const change *c) {
  api_text json = {0};
  int64_t number = 0;
  row->state = API_JOB_FAILED;
  api_job_write(&(api_job_view){.id = row->id,
                                .result = row->key,
                                .problem = c->problem,
                                .kind = row->kind,
                                .state = row->state,
                                .attempt = row->attempt,
                                .created = row->created,
                                .started = row->started,
                                .finished = c->now},
                &json);
  sqlite3_stmt *st = database_statement(db, "SELECT coalesce(max(number), 0) + 1 FROM event WHERE job=?1");
  if (!st || json.failed) {
    api_text_free(&json);
    return SQLITE_NOMEM;
  }
  sqlite3_bind_text(st, 1, row->id, -1, SQLITE_STATIC);
  int code = sqlite3_step(st);
  number = code == SQLITE_ROW ? sqlite3_column_int64(st, 0) : 0;
  sqlite3_reset(st);
  code = code == SQLITE_ROW ? write_event(db, row->id, number, api_job_state_name(row->state), json.data) : code;
  code = code == SQLITE_OK ? delivery_announce(db, row->id, row->state, json.data, c->now) : code;
  api_text_free(&json);
  if (code == SQLITE_OK) {
    st = database_statement(db, "UPDATE job SET state=3, problem=?1, finished=?2 WHERE id=?3");
    if (!st) {
      return SQLITE_ERROR;
    }
    sqlite3_bind_text(st, 1, c->problem, -1, SQLITE_STATIC);
    sqlite3_bind_int64(st, 2, c->now);
    sqlite3_bind_text(st, 3, row->id, -1, SQLITE_STATIC);
    code = database_run(db, st);
  }
  return code;
}

/* Retry after a crash: jobs that were running are queued again as suspects. A crash counts against a job only if it ran
 * alone, on purpose or because no other job was running. */
static int recover(database *db, void *arg) {
  const change *c = arg;
  if (c->attempt == 0) {
    return database_run(db, database_statement(db, "UPDATE job SET state=0, alone=0 WHERE state=1"));
  }
  sqlite3_stmt *st = database_statement(db,
                                        "UPDATE job SET crashes=crashes+1 WHERE state=1 AND"
                                        " (alone=1 OR (SELECT count(*) FROM job WHERE state=1)=1)");
  int code = database_run(db, st);
  if (code == SQLITE_OK) {
    code = database_run(db, database_statement(db, "UPDATE job SET state=0, suspect=1, alone=0 WHERE state=1"));
  }
  while (code == SQLITE_OK) { /* rarely more than one job */
    job_row row;
    st = database_statement(db, "SELECT " COLUMNS " FROM job WHERE state=0 AND crashes>=?1 ORDER BY seq LIMIT 1");
    if (!st) {
      return SQLITE_ERROR;
    }
    sqlite3_bind_int(st, 1, c->attempt);
    code = sqlite3_step(st);
    if (code == SQLITE_DONE) {
      sqlite3_reset(st);
      return SQLITE_OK;
    }
    if (code == SQLITE_ROW) {
      code = read_row(st, &row) ? SQLITE_OK : SQLITE_NOMEM;
      if (code != SQLITE_OK) {
        job_row_free(&row);
      }
    }
    sqlite3_reset(st);
    if (code == SQLITE_OK) {
      code = give_up(db, &row, c);
      job_row_free(&row);
    }
  }
  return code;
}

store_result catalogue_recover(catalogue *cat, int most_crashes, int64_t now, const char *crash_problem) {
  change c = {.attempt = most_crashes, .now = now, .problem = crash_problem};
  return catalogue_write(cat, recover, &c);
}

int64_t catalogue_jobs_ended(catalogue *cat) {
  database *db = catalogue_reader(cat);
  sqlite3_stmt *st = database_statement(db, "SELECT count(*) FROM job WHERE state>=2");
  return rows_integer(cat, db, st);
}

/* NOT INDEXED scans in row order: nearly all of the oldest jobs have ended, so this finds them without a sort. */
#define OLDEST_ENDED " FROM job NOT INDEXED WHERE state>=2 ORDER BY seq LIMIT ?1)"

static int forget(database *db, void *arg) {
  static const char *const steps[] = {"DELETE FROM event WHERE job IN (SELECT id" OLDEST_ENDED,
                                      "DELETE FROM delivery WHERE state<>0 AND job IN (SELECT id" OLDEST_ENDED,
                                      "DELETE FROM job WHERE seq IN (SELECT seq" OLDEST_ENDED};
  int code = SQLITE_OK;
  for (int i = 0; i < 3 && code == SQLITE_OK; i++) {
    sqlite3_stmt *st = database_statement(db, steps[i]);
    if (st) {
      sqlite3_bind_int(st, 1, *(const int *)arg);
    }
    code = database_run(db, st);
  }
  return code;
}

store_result catalogue_jobs_forget(catalogue *cat, int count) {
  return catalogue_write(cat, forget, &count);
}

typedef struct event_arg {
  char job[API_JOB_ID_SIZE], type[16];
  int64_t number;
  char json[];
} event_arg;

static int put_event(database *db, void *arg) {
  const event_arg *e = arg;
  return write_event(db, e->job, e->number, e->type, e->json);
}

void catalogue_event(catalogue *cat, const char *job, int64_t number, const char *type, const char *json) {
  size_t size = strlen(json) + 1;
  event_arg *e = calloc(1, sizeof *e + size);
  if (e) {
    snprintf(e->job, sizeof e->job, "%s", job);
    snprintf(e->type, sizeof e->type, "%s", type);
    e->number = number;
    memcpy(e->json, json, size);
    catalogue_write_later(cat, put_event, e);
  }
}

static int read_event(sqlite3_stmt *st, void *to) {
  event_row *out = to;
  out->number = sqlite3_column_int64(st, 0);
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
  sqlite3_stmt *st = database_statement(
      db, "SELECT number, type, json FROM event WHERE job=?1 AND number>?2 ORDER BY number LIMIT ?3");
  if (st) {
    sqlite3_bind_text(st, 1, job, -1, SQLITE_STATIC);
    sqlite3_bind_int64(st, 2, after);
    sqlite3_bind_int(st, 3, limit);
  }
  return rows_many(cat, db, st, &event_rows, out, limit);
}
