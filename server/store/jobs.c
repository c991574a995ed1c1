/* Rows of jobs and events. */
#include <stdlib.h>

#include "store/crashes.h"
#include "store/deliveries.h"
#include "store/owners.h"
#include "store/rows.h"
#include "store/usage.h"

#define COLUMNS JOB_COLUMNS

void job_row_free(job_row *row) {
  free(row->request);
  free(row->problem);
  row->request = row->problem = NULL;
}

static int insert_row(database *db, job_row *r) {
  sql_statement *st = database_statement(
      db,
      "INSERT INTO job(id, key, kind, state, attempt, listed, priority, cost, owner, request, created,"
      " charged, trace) VALUES(?1, ?2, ?3, 0, 0, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11) RETURNING seq");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, r->id);
  sql_bind_text(st, 2, r->key);
  sql_bind_integer(st, 3, (int)r->kind);
  sql_bind_integer(st, 4, r->listed);
  sql_bind_integer(st, 5, r->priority);
  sql_bind_integer(st, 6, r->cost);
  sql_bind_text(st, 7, r->owner);
  sql_bind_text(st, 8, r->request);
  sql_bind_integer(st, 9, r->created);
  sql_bind_text(st, 10, r->charged);
  sql_bind_text(st, 11, r->trace);
  int code = sql_step(st);
  r->seq = code == SQL_ROW ? sql_integer(st, 0) : 0;
  if (code != SQL_ROW) {
    log_error("catalogue: %s", db->connection.driver->message(&db->connection));
  }
  sql_reset(st);
  return code == SQL_ROW ? SQL_OK : code;
}

int job_insert(database *db, job_row *r, const job_webhook *hook) {
  int code = crash_check(db, r->key);
  code = code == SQL_OK ? insert_row(db, r) : code;
  code = code == SQL_OK ? owner_of_meshes(db, r->request, r->owner, r->created, r->listed) : code;
  return code == SQL_OK && hook ? delivery_subscribe(db, r->id, hook) : code;
}

typedef struct insert_arg {
  job_row *row;
  const job_webhook *hook;
} insert_arg;

static int insert(database *db, void *arg) {
  const insert_arg *a = arg;
  return job_insert(db, a->row, a->hook);
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
  const char *node; /* of several */
} change;

/* Runs an update that must change exactly one row. */
static int must_change(database *db, sql_statement *st) {
  int code = database_run(db, st);
  return code == SQL_OK && sql_changes(db) != 1 ? SQL_CONSTRAINT : code;
}

static int list_it(database *db, void *arg) {
  sql_statement *st = database_statement(db, "UPDATE job SET listed=1 WHERE id=?1");
  if (st) {
    sql_bind_text(st, 1, arg);
  }
  return must_change(db, st);
}

store_result catalogue_job_list_it(catalogue *cat, const char *id) {
  return catalogue_write(cat, list_it, (void *)(uintptr_t)id);
}

static int claim(database *db, void *arg) {
  const change *c = arg;
  sql_statement *st = database_statement(db,
                                         "UPDATE job SET state=1, attempt=?2, alone=?3,"
                                         " started=CASE started WHEN 0 THEN ?4 ELSE started END"
                                         " WHERE id=?1 AND state<2 AND attempt=?2-1");
  if (st) {
    sql_bind_text(st, 1, c->id);
    sql_bind_integer(st, 2, c->attempt);
    sql_bind_integer(st, 3, c->alone);
    sql_bind_integer(st, 4, c->now);
  }
  return must_change(db, st);
}

store_result catalogue_job_claim(catalogue *cat, const char *id, int attempt, int alone, int64_t now) {
  change c = {.id = id, .attempt = attempt, .alone = alone, .now = now};
  return catalogue_write(cat, claim, &c);
}

static int release(database *db, void *arg) {
  const change *c = arg;
  sql_statement *st =
      database_statement(db, "UPDATE job SET state=0, attempt=?2-1, alone=0 WHERE id=?1 AND state=1 AND attempt=?2");
  if (st) {
    sql_bind_text(st, 1, c->id);
    sql_bind_integer(st, 2, c->attempt);
  }
  return must_change(db, st);
}

store_result catalogue_job_release(catalogue *cat, const char *id, int attempt) {
  change c = {.id = id, .attempt = attempt};
  return catalogue_write(cat, release, &c);
}

static int crashed(database *db, void *arg) {
  const change *c = arg;
  sql_statement *st = database_statement(
      db, "UPDATE job SET state=0, alone=0, crashes=crashes+?3, suspect=?4 WHERE id=?1 AND state=1 AND attempt=?2");
  if (st) {
    sql_bind_text(st, 1, c->id);
    sql_bind_integer(st, 2, c->attempt);
    sql_bind_integer(st, 3, c->counts);
    sql_bind_integer(st, 4, c->alone);
  }
  int code = must_change(db, st);
  return code == SQL_OK && c->counts ? crash_note(db, c->row->key, c->row->request, c->row->owner, c->now) : code;
}

store_result catalogue_job_crashed(catalogue *cat, const job_row *row, int counts, int suspect, int64_t now) {
  change c = {.id = row->id, .attempt = row->attempt, .counts = counts, .alone = suspect, .row = row, .now = now};
  return catalogue_write(cat, crashed, &c);
}

static int write_event(database *db, const char *job, int64_t number, const char *type, const char *json) {
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

static int finish(database *db, void *arg) {
  const change *c = arg;
  const job_end *end = c->end;
  sql_statement *st = database_statement(db,
                                         "UPDATE job SET state=?3, problem=?4, finished=?5, suspect=0, alone=0,"
                                         " result=?6 WHERE id=?1 AND attempt=?2 AND state<2");
  if (st) {
    sql_bind_text(st, 1, c->id);
    sql_bind_integer(st, 2, c->attempt);
    sql_bind_integer(st, 3, (int)end->state);
    sql_bind_text(st, 4, end->problem);
    sql_bind_integer(st, 5, end->now);
    sql_bind_text(st, 6, end->mesh ? end->mesh : "");
  }
  int code = must_change(db, st);
  if (code == SQL_OK && end->result) {
    code = resource_insert(db, end->result);
  }
  if (code == SQL_OK && end->state == API_JOB_SUCCEEDED && !end->mesh) {
    code = owner_of_job(db, c->id, end->now);
  }
  if (code == SQL_OK && end->worker_ms > 0) {
    code = usage_add_time(db, end->owner, end->worker_ms);
  }
  if (code == SQL_OK && end->event_json) {
    code = write_event(db, c->id, end->event, api_job_state_name(end->state), end->event_json);
  }
  if (code == SQL_OK && end->event_json) {
    code = delivery_announce(db, c->id, end->state, end->event_json, end->now);
  }
  return code;
}

store_result catalogue_job_finish(catalogue *cat, const char *id, int attempt, const job_end *end) {
  change c = {.id = id, .attempt = attempt, .end = end};
  return end->result ? catalogue_write_held(cat, finish, &c) : catalogue_write(cat, finish, &c);
}

static int read_row(sql_statement *st, void *to) {
  job_row *out = to;
  memset(out, 0, sizeof *out);
  out->seq = sql_integer(st, 0);
  row_text(st, 1, out->id, sizeof out->id);
  row_text(st, 2, out->key, sizeof out->key);
  out->kind = (api_job_kind)sql_int(st, 3);
  out->state = (api_job_state)sql_int(st, 4);
  out->attempt = sql_int(st, 5);
  out->crashes = sql_int(st, 6);
  out->suspect = sql_int(st, 7);
  out->alone = sql_int(st, 8);
  out->listed = sql_int(st, 9);
  out->priority = sql_int(st, 10);
  out->cost = sql_integer(st, 11);
  row_text(st, 12, out->owner, sizeof out->owner);
  out->request = row_copy(st, 13);
  out->problem = row_copy(st, 14);
  out->created = sql_integer(st, 15);
  out->started = sql_integer(st, 16);
  out->finished = sql_integer(st, 17);
  row_text(st, 18, out->charged, sizeof out->charged);
  row_text(st, 19, out->result, sizeof out->result);
  row_text(st, 20, out->trace, sizeof out->trace);
  return out->request != NULL && !row_lacks(st, 14, out->problem);
}
static void release_row(void *row) {
  job_row_free(row);
}
const row_kind job_rows = {read_row, release_row, sizeof(job_row)};

store_result catalogue_job_get(catalogue *cat, const char *id, job_row *out) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(db, database_either(db, "SELECT " COLUMNS " FROM job WHERE id=?1",
                                                             "SELECT " JOB_COLUMNS_SHOWN " FROM job WHERE id=?1"));
  if (st) {
    sql_bind_text(st, 1, id);
  }
  return rows_one(cat, db, st, &job_rows, out);
}

/* Listed jobs of state ?1 (−1: any, −2: queued or running) with a sequence number below ?2. */
#define LISTED " FROM job WHERE listed=1 AND (?1=-1 OR state=?1 OR (?1=-2 AND state<2)) AND "
/* Those whose id begins with ?5, through the index of ids; in SQLite, a "+" keeps it from using another index. */
#define NAMED(seq) "id>=?5 AND id<?5 || 'g' AND " seq "<?2"

int catalogue_job_list(catalogue *cat, const char *owner, const char *prefix, int state, int64_t before, int limit,
                       job_row *out) {
  static const char *const queries[2][2] = {
      {"SELECT " COLUMNS LISTED "seq<?2 ORDER BY seq DESC LIMIT ?3",
       "SELECT " COLUMNS LISTED "seq<?2 AND owner=?4 ORDER BY seq DESC LIMIT ?3"},
      {"SELECT " COLUMNS LISTED NAMED("+seq") " ORDER BY +seq DESC LIMIT ?3",
       "SELECT " COLUMNS LISTED NAMED("+seq") " AND +owner=?4 ORDER BY +seq DESC LIMIT ?3"}};
  static const char *const plain[2][2] = {
      {"SELECT " JOB_COLUMNS_SHOWN LISTED "seq<?2 ORDER BY seq DESC LIMIT ?3",
       "SELECT " JOB_COLUMNS_SHOWN LISTED "seq<?2 AND owner=?4 ORDER BY seq DESC LIMIT ?3"},
      {"SELECT " JOB_COLUMNS_SHOWN LISTED NAMED("seq") " ORDER BY seq DESC LIMIT ?3",
       "SELECT " JOB_COLUMNS_SHOWN LISTED NAMED("seq") " AND owner=?4 ORDER BY seq DESC LIMIT ?3"}};
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(
      db, database_either(db, queries[prefix != NULL][owner != NULL], plain[prefix != NULL][owner != NULL]));
  if (st && owner) {
    sql_bind_text(st, 4, owner);
  }
  if (st && prefix) {
    sql_bind_text(st, 5, prefix);
  }
  if (st) {
    sql_bind_integer(st, 1, state);
    sql_bind_integer(st, 2, before > 0 ? before : INT64_MAX);
    sql_bind_integer(st, 3, limit);
  }
  return rows_many(cat, db, st, &job_rows, out, limit);
}

int catalogue_unfinished(catalogue *cat, int64_t after, int limit, job_row *out) {
  database *db = catalogue_reader(cat);
  sql_statement *st =
      database_statement(db, "SELECT " COLUMNS " FROM job WHERE state<2 AND seq>?1 ORDER BY seq LIMIT ?2");
  if (st) {
    sql_bind_integer(st, 1, after);
    sql_bind_integer(st, 2, limit);
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
  sql_statement *st = database_statement(db, "SELECT coalesce(max(number), 0) + 1 FROM event WHERE job=?1");
  if (!st || json.failed) {
    api_text_free(&json);
    return SQL_NOMEM;
  }
  sql_bind_text(st, 1, row->id);
  int code = sql_step(st);
  number = code == SQL_ROW ? sql_integer(st, 0) : 0;
  sql_reset(st);
  code = code == SQL_ROW ? write_event(db, row->id, number, api_job_state_name(row->state), json.data) : code;
  code = code == SQL_OK ? delivery_announce(db, row->id, row->state, json.data, c->now) : code;
  api_text_free(&json);
  if (code == SQL_OK) {
    st = database_statement(db, "UPDATE job SET state=3, problem=?1, finished=?2 WHERE id=?3");
    if (!st) {
      return SQL_ERROR;
    }
    sql_bind_text(st, 1, c->problem);
    sql_bind_integer(st, 2, c->now);
    sql_bind_text(st, 3, row->id);
    code = database_run(db, st);
  }
  return code;
}

/* Fails the queued jobs that have crashed alone too often; rarely more than one. */
static int give_up_all(database *db, const change *c) {
  for (;;) {
    job_row row;
    sql_statement *st =
        database_statement(db, "SELECT " COLUMNS " FROM job WHERE state=0 AND crashes>=?1 ORDER BY seq LIMIT 1");
    if (!st) {
      return SQL_ERROR;
    }
    sql_bind_integer(st, 1, c->attempt);
    int code = sql_step(st);
    if (code == SQL_DONE) {
      sql_reset(st);
      return SQL_OK;
    }
    if (code == SQL_ROW) {
      code = read_row(st, &row) ? SQL_OK : SQL_NOMEM;
      if (code != SQL_OK) {
        job_row_free(&row);
      }
    }
    sql_reset(st);
    if (code == SQL_OK) {
      code = give_up(db, &row, c);
      job_row_free(&row);
    }
    if (code != SQL_OK) {
      return code;
    }
  }
}

/* Retry after a crash: jobs that were running are queued again as suspects. A crash counts against a job only if it ran
 * alone, on purpose or because no other job was running. */
static int recover(database *db, void *arg) {
  const change *c = arg;
  if (c->attempt == 0) {
    return database_run(db, database_statement(db, "UPDATE job SET state=0, alone=0 WHERE state=1"));
  }
  sql_statement *st = database_statement(db,
                                         "UPDATE job SET crashes=crashes+1 WHERE state=1 AND"
                                         " (alone=1 OR (SELECT count(*) FROM job WHERE state=1)=1)");
  int code = database_run(db, st);
  if (code == SQL_OK) {
    code = database_run(db, database_statement(db, "UPDATE job SET state=0, suspect=1, alone=0 WHERE state=1"));
  }
  return code == SQL_OK ? give_up_all(db, c) : code;
}

/* The jobs of this node's last life: its end was not theirs, as they have processes of their own. Those of other nodes
 * that are gone: they may have been the cause, but for downloads. */
static int recover_lost(database *db, void *arg) {
  const change *c = arg;
  sql_statement *st = database_statement(db, "UPDATE job SET state=0, alone=0 WHERE state=1 AND node=?1 AND node<>''");
  int code = SQL_ERROR;
  if (st) {
    sql_bind_text(st, 1, c->node);
    code = database_run(db, st);
  }
  if (code != SQL_OK || !c->counts) {
    return code;
  }
  st = code == SQL_OK
           ? database_statement(db,
                                "UPDATE job SET state=0, crashes=crashes+alone, alone=0,"
                                " suspect=CASE kind WHEN 2 THEN 0 ELSE 1 END"
                                " WHERE state=1 AND node NOT IN (SELECT name FROM node WHERE until>=clock_ms())")
           : NULL;
  code = st ? database_run(db, st) : code;
  if (code == SQL_OK && sql_changes(db) > 0) {
    log_warn("jobs of a node that was silent beyond its lease are queued again");
  }
  st = code == SQL_OK ? database_statement(db, "DELETE FROM node WHERE until<clock_ms() OR name=?1") : NULL;
  if (st) {
    sql_bind_text(st, 1, c->node);
    code = database_run(db, st);
  }
  return code == SQL_OK ? give_up_all(db, c) : code;
}

store_result catalogue_recover_own(catalogue *cat, const char *last_life) {
  change c = {.node = last_life};
  return catalogue_write(cat, recover_lost, &c);
}

typedef struct lost_arg {
  change change; /* first */
  char problem[];
} lost_arg;

void catalogue_recover_lost(catalogue *cat, int most_crashes, int64_t now, const char *crash_problem) {
  size_t size = strlen(crash_problem) + 1;
  lost_arg *a = calloc(1, sizeof *a + size);
  if (a) {
    memcpy(a->problem, crash_problem, size);
    a->change = (change){.node = "", .counts = 1, .attempt = most_crashes, .now = now, .problem = a->problem};
    catalogue_write_later(cat, recover_lost, a);
  }
}

store_result catalogue_recover(catalogue *cat, int most_crashes, int64_t now, const char *crash_problem) {
  change c = {.attempt = most_crashes, .now = now, .problem = crash_problem};
  return catalogue_write(cat, recover, &c);
}

int64_t catalogue_jobs_ended(catalogue *cat) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(db, "SELECT count(*) FROM job WHERE state>=2");
  return rows_integer(cat, db, st);
}

/* In SQLite, NOT INDEXED scans in row order: nearly all of the oldest jobs have ended, so this finds them without a
 * sort. */
#define OLDEST(how) " FROM job" how " WHERE state>=2 ORDER BY seq LIMIT ?1)"
#define FORGET(how)                                                              \
  {                                                                              \
    "DELETE FROM event WHERE job IN (SELECT id" OLDEST(how),                     \
        "DELETE FROM delivery WHERE state<>0 AND job IN (SELECT id" OLDEST(how), \
        "DELETE FROM job WHERE seq IN (SELECT seq" OLDEST(how)                   \
  }

static int forget(database *db, void *arg) {
  static const char *const steps[3] = FORGET(" NOT INDEXED"), *const plain[3] = FORGET("");
  int code = SQL_OK;
  for (int i = 0; i < 3 && code == SQL_OK; i++) {
    sql_statement *st = database_statement(db, database_either(db, steps[i], plain[i]));
    if (st) {
      sql_bind_integer(st, 1, *(const int *)arg);
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
