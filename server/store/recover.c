/* Queues or fails the jobs that ran when their process or node ended. */
#include <stdlib.h>

#include "store/deliveries.h"
#include "store/rows.h"

typedef struct recovery {
  const char *node;    /* the node's name before its restart; "": none */
  int others;          /* also the jobs of other nodes whose lease has expired */
  int most_crashes;    /* 0: the jobs had processes of their own, and their ends were counted */
  int counted_from;    /* attempts of a job: the loss of a node counts from this one on */
  const char *problem; /* of a job that crashed so often */
  int64_t now;
} recovery;

/* Fails a job that crashed alone too often, and writes its final event for clients that follow it. */
static int give_up(database *db, job_row *row, const recovery *c) {
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
  code = code == SQL_ROW ? event_insert(db, row->id, number, api_job_state_name(row->state), json.data) : code;
  code = code == SQL_OK ? delivery_announce(db, row->id, row->state, json.data, c->now) : code;
  api_text_free(&json);
  if (code == SQL_OK) {
    st = database_statement(
        db, "UPDATE job SET state=3, problem=?1, finished=?2, request='{}', request_bytes=0 WHERE id=?3");
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
static int give_up_all(database *db, const recovery *c) {
  for (;;) {
    job_row row;
    sql_statement *st =
        database_statement(db, "SELECT " JOB_COLUMNS " FROM job WHERE state=0 AND crashes>=?1 ORDER BY seq LIMIT 1");
    if (!st) {
      return SQL_ERROR;
    }
    sql_bind_integer(st, 1, c->most_crashes);
    int code = sql_step(st);
    if (code == SQL_DONE) {
      sql_reset(st);
      return SQL_OK;
    }
    if (code == SQL_ROW) {
      code = job_rows.read(st, &row) ? SQL_OK : SQL_NOMEM;
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
  const recovery *c = arg;
  if (c->most_crashes == 0) {
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

/* Queues the jobs that this node ran before its restart. They did not cause its end, because they have processes of
 * their own. With `others`, also queues the jobs of nodes that are gone, as suspects: they may have been the cause,
 * except downloads.
 */
static int recover_lost(database *db, void *arg) {
  const recovery *c = arg;
  sql_statement *st = database_statement(db, "UPDATE job SET state=0, alone=0 WHERE state=1 AND node=?1 AND node<>''");
  int code = SQL_ERROR;
  if (st) {
    sql_bind_text(st, 1, c->node);
    code = database_run(db, st);
  }
  if (code != SQL_OK || !c->others) {
    return code;
  }
  st =
      database_statement(db,
                         "UPDATE job SET state=0, crashes=crashes+CASE WHEN attempt>=?1 THEN alone ELSE 0 END, alone=0,"
                         " suspect=CASE kind WHEN 2 THEN 0 ELSE 1 END"
                         " WHERE state=1 AND node NOT IN (SELECT name FROM node WHERE until>=clock_ms())");
  code = SQL_ERROR;
  if (st) {
    sql_bind_integer(st, 1, c->counted_from);
    code = database_run(db, st);
  }
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
  recovery c = {.node = last_life};
  return catalogue_write(cat, recover_lost, &c);
}

typedef struct lost_arg {
  recovery what; /* first */
  char problem[];
} lost_arg;

void catalogue_recover_lost(catalogue *cat, int most_crashes, int counted_from, int64_t now,
                            const char *crash_problem) {
  size_t size = strlen(crash_problem) + 1;
  lost_arg *a = calloc(1, sizeof *a + size);
  if (a) {
    memcpy(a->problem, crash_problem, size);
    a->what = (recovery){.node = "",
                         .others = 1,
                         .most_crashes = most_crashes,
                         .counted_from = counted_from,
                         .now = now,
                         .problem = a->problem};
    catalogue_write_later(cat, recover_lost, a);
  }
}

store_result catalogue_recover(catalogue *cat, int most_crashes, int64_t now, const char *crash_problem) {
  recovery c = {.most_crashes = most_crashes, .now = now, .problem = crash_problem};
  return catalogue_write(cat, recover, &c);
}
