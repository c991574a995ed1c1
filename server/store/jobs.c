/* Rows of jobs. */
#include <stdlib.h>

#include "store/crashes.h"
#include "store/deliveries.h"
#include "store/owners.h"
#include "store/rows.h"
#include "store/usage.h"

void job_row_free(job_row *row) {
  free(row->request);
  free(row->problem);
  row->request = row->problem = NULL;
}

static int insert_row(database *db, job_row *r) {
  sql_statement *st = database_statement(
      db,
      "INSERT INTO job(id, key, kind, state, attempt, listed, priority, cost, owner, request, created,"
      " charged, trace, request_bytes) VALUES(?1, ?2, ?3, 0, 0, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12) RETURNING seq");
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
  sql_bind_integer(st, 12, (int64_t)strlen(r->request));
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
  const char *id;
  int attempt, alone, counts;
  const job_row *row;
  int64_t now;
  const job_end *end;
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

static int finish(database *db, void *arg) {
  const change *c = arg;
  const job_end *end = c->end;
  sql_statement *st = database_statement(db,
                                         "UPDATE job SET state=?3, problem=?4, finished=?5, suspect=0, alone=0,"
                                         " result=?6, started=CASE started WHEN 0 THEN ?7 ELSE started END,"
                                         " request='{}', request_bytes=0"
                                         " WHERE id=?1 AND attempt=?2 AND state<2");
  if (st) {
    sql_bind_text(st, 1, c->id);
    sql_bind_integer(st, 2, c->attempt);
    sql_bind_integer(st, 3, (int)end->state);
    sql_bind_text(st, 4, end->problem);
    sql_bind_integer(st, 5, end->now);
    sql_bind_text(st, 6, end->mesh ? end->mesh : "");
    sql_bind_integer(st, 7, end->started);
  }
  int code = database_run_later(db, st, SQL_ONE_CHANGE);
  if (code == SQL_OK && end->result) {
    code = resource_insert(db, end->result, NULL);
  }
  if (code == SQL_OK && end->state == API_JOB_SUCCEEDED && !end->mesh) {
    code = owner_of_job(db, c->id, end->now, end->result != NULL);
  }
  if (code == SQL_OK && end->worker_ms > 0) {
    code = usage_add_time(db, end->owner, end->worker_ms);
  }
  if (code == SQL_OK && end->event_json) {
    code = event_insert(db, c->id, end->event, api_job_state_name(end->state), end->event_json);
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
  out->problem = row_copy(st, 13);
  out->created = sql_integer(st, 14);
  out->started = sql_integer(st, 15);
  out->finished = sql_integer(st, 16);
  row_text(st, 17, out->charged, sizeof out->charged);
  row_text(st, 18, out->result, sizeof out->result);
  row_text(st, 19, out->trace, sizeof out->trace);
  out->request_bytes = sql_integer(st, 20);
  return !row_lacks(st, 13, out->problem);
}
static void release_row(void *row) {
  job_row_free(row);
}
const row_kind job_rows = {read_row, release_row, sizeof(job_row)};

store_result catalogue_job_get(catalogue *cat, const char *id, job_row *out) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(db, database_either(db, "SELECT " JOB_COLUMNS " FROM job WHERE id=?1",
                                                             "SELECT " JOB_COLUMNS_SHOWN " FROM job WHERE id=?1"));
  if (st) {
    sql_bind_text(st, 1, id);
  }
  return rows_one(cat, db, st, &job_rows, out);
}

static int read_request(sql_statement *st, void *out) {
  char *text = row_copy(st, 0);
  *(char **)out = text;
  return text != NULL;
}

char *catalogue_job_request(catalogue *cat, const char *id) {
  static const row_kind requests = {.read = read_request, .size = sizeof(char *)};
  char *text = NULL;
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(db, "SELECT request FROM job WHERE id=?1");
  if (st) {
    sql_bind_text(st, 1, id);
  }
  return rows_one(cat, db, st, &requests, &text) == STORE_OK ? text : NULL;
}

/* Listed jobs of state ?1 (−1: any, −2: queued or running) with a sequence number below ?2. */
#define LISTED " FROM job WHERE listed=1 AND (?1=-1 OR state=?1 OR (?1=-2 AND state<2)) AND "
/* Only jobs whose id begins with ?5, through the index of ids. In SQLite, a "+" keeps the planner from using another
 * index. */
#define NAMED(seq) "id>=?5 AND id<?5 || 'g' AND " seq "<?2"

int catalogue_job_list(catalogue *cat, const char *owner, const char *prefix, int state, int64_t before, int limit,
                       job_row *out) {
  static const char *const queries[2][2] = {
      {"SELECT " JOB_COLUMNS LISTED "seq<?2 ORDER BY seq DESC LIMIT ?3",
       "SELECT " JOB_COLUMNS LISTED "seq<?2 AND owner=?4 ORDER BY seq DESC LIMIT ?3"},
      {"SELECT " JOB_COLUMNS LISTED NAMED("+seq") " ORDER BY +seq DESC LIMIT ?3",
       "SELECT " JOB_COLUMNS LISTED NAMED("+seq") " AND +owner=?4 ORDER BY +seq DESC LIMIT ?3"}};
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
      database_statement(db, "SELECT " JOB_COLUMNS " FROM job WHERE state<2 AND seq>?1 ORDER BY seq LIMIT ?2");
  if (st) {
    sql_bind_integer(st, 1, after);
    sql_bind_integer(st, 2, limit);
  }
  return rows_many(cat, db, st, &job_rows, out, limit);
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
