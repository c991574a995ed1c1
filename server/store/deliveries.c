#include "store/deliveries.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "store/rows.h"

void delivery_row_free(delivery_row *row) {
  free(row->body);
  row->body = NULL;
}

static int64_t now_ms(void) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* Runs a statement whose parameter ?1 is a job, and ?2, if it has one, a time. */
static int run_for(database *db, const char *sql, const char *job, int64_t now) {
  sql_statement *st = database_statement(db, sql);
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, job);
  sql_bind_integer(st, 2, now);
  return database_run(db, st);
}

/* The first webhook of a job creates its tenant's secret if there is none. */
static int ensure_secret(database *db, const char *job) {
  char tenant[64] = "";
  sql_statement *st = database_statement(db, "SELECT owner FROM job WHERE id=?1");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, job);
  int code = sql_step(st);
  if (code == SQL_ROW) {
    row_text(st, 0, tenant, sizeof tenant);
  }
  sql_reset(st);
  return code == SQL_ROW ? webhook_ensure_secret(db, tenant) : code == SQL_DONE ? SQL_NOTFOUND : code;
}

int delivery_subscribe(database *db, const char *job, const job_webhook *hook) {
  int code = ensure_secret(db, job);
  sql_statement *st =
      code == SQL_OK
          ? database_statement(db,
                               "INSERT INTO job_webhook(job, url, origin, events) SELECT ?1, ?2, ?3, ?4"
                               " WHERE (SELECT count(*) FROM job_webhook WHERE job=?1 AND url<>?2) < ?5"
                               " ON CONFLICT(job, url) DO UPDATE SET events=job_webhook.events|excluded.events")
          : NULL;
  if (!st) {
    return code == SQL_OK ? SQL_ERROR : code;
  }
  sql_bind_text(st, 1, job);
  sql_bind_text(st, 2, hook->url);
  sql_bind_text(st, 3, hook->origin);
  sql_bind_integer(st, 4, hook->events);
  sql_bind_integer(st, 5, JOB_WEBHOOKS);
  code = database_run(db, st);
  return code == SQL_OK && sql_changes(db) == 0 ? SQL_CONSTRAINT : code;
}

/* Numbers continue after those of the job's other deliveries; {n} of a path has two digits. */
#define ADD_DELIVERIES                                                                                                 \
  "INSERT INTO delivery(job, number, webhook, receiver, url, type, body, next, created)"                               \
  " SELECT ?1, (SELECT coalesce(max(number), 0) FROM delivery WHERE job=?1) + row_number() OVER (ORDER BY own, name)," \
  "  name, receiver, url, ?3, ?4, ?2, ?2 FROM"                                                                         \
  " (SELECT 0 AS own, '@'||j.owner AS name, j.owner||' '||h.origin AS receiver, h.url AS url"                          \
  "   FROM job j JOIN job_webhook h ON h.job=j.id WHERE j.id=?1 AND (h.events & ?5) <> 0"                              \
  "  UNION ALL SELECT 1, w.name, j.owner||' '||w.origin, w.url"                                                        \
  "   FROM job j JOIN webhook w ON w.tenant=j.owner"                                                                   \
  "   WHERE j.id=?1 AND j.listed=1 AND w.url<>'' AND (w.events & ?5) <> 0 AND ?6<>0) AS due"                           \
  " LIMIT ?7"
#define ADD_RECEIVERS(of)                                                                 \
  "INSERT INTO receiver(name, tenant, next) SELECT d.receiver, j.owner, min(d.next)"      \
  " FROM " of                                                                             \
  " d JOIN job j ON j.id=d.job WHERE d.job=?1 AND d.state=0 GROUP BY d.receiver, j.owner" \
  " ON CONFLICT(name) DO UPDATE SET next=iif(excluded.next<receiver.next, excluded.next, receiver.next)"
#define DROP_SUBSCRIPTIONS "DELETE FROM job_webhook WHERE job=?1"
static const char add_deliveries[] = ADD_DELIVERIES, add_receivers[] = ADD_RECEIVERS("delivery"),
                  drop_subscriptions[] = DROP_SUBSCRIPTIONS;

/* All three in one statement, for PostgreSQL. Its parts see the rows as they were before. */
static const char add_all[] = "WITH d AS (" ADD_DELIVERIES " RETURNING *), dropped AS (" DROP_SUBSCRIPTIONS
                              " AND ?6<>0) " ADD_RECEIVERS("(SELECT * FROM d)");

static int is_one_statement(const database *db) {
  return db->connection.driver == &sql_postgresql;
}

static int announce_to(database *db, const char *job, api_job_state state, const char *json, int64_t now, int all) {
  api_text body = {0};
  char type[24];
  api_webhook_body_write(state, now, json, &body);
  snprintf(type, sizeof type, "job.%s", api_job_state_name(state));
  sql_statement *st = body.failed ? NULL : database_statement(db, database_either(db, add_deliveries, add_all));
  int code = body.failed ? SQL_NOMEM : SQL_ERROR;
  if (st) {
    sql_bind_text(st, 1, job);
    sql_bind_integer(st, 2, now);
    sql_bind_text(st, 3, type);
    sql_bind_text(st, 4, body.data);
    sql_bind_integer(st, 5, API_EVENT(state));
    sql_bind_integer(st, 6, all);
    sql_bind_integer(st, 7, DELIVERIES_OF_JOB);
    code = is_one_statement(db) ? database_run_later(db, st, SQL_ANY) : database_run(db, st);
  }
  api_text_free(&body);
  if (code != SQL_OK || is_one_statement(db) || sql_changes(db) == 0) {
    return code;
  }
  return run_for(db, add_receivers, job, now);
}

int delivery_announce(database *db, const char *job, api_job_state state, const char *json, int64_t now) {
  int code = announce_to(db, job, state, json, now, 1);
  return code == SQL_OK && !is_one_statement(db) ? run_for(db, drop_subscriptions, job, now) : code;
}

typedef struct subscribe_arg {
  const char *job;
  const job_webhook *hook;
} subscribe_arg;

/* Reads the state and the last event of a job. *json NULL: it has not ended. */
static int ended_as(database *db, const char *job, api_job_state *state, char **json) {
  sql_statement *st = database_statement(db,
                                         "SELECT j.state, e.json FROM job j JOIN event e ON e.job=j.id"
                                         " WHERE j.id=?1 AND j.state>=2 ORDER BY e.number DESC LIMIT 1");
  *json = NULL;
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, job);
  int code = sql_step(st);
  if (code == SQL_ROW) {
    *state = (api_job_state)sql_int(st, 0);
    *json = row_copy(st, 1);
    code = *json ? SQL_DONE : SQL_NOMEM;
  }
  sql_reset(st);
  return code == SQL_DONE ? SQL_OK : code;
}

static int subscribe(database *db, void *arg) {
  const subscribe_arg *s = arg;
  api_job_state state;
  char *json = NULL;
  int code = delivery_subscribe(db, s->job, s->hook);
  if (code == SQL_OK) {
    code = ended_as(db, s->job, &state, &json);
  }
  if (json) {
    int64_t now = now_ms();
    code = announce_to(db, s->job, state, json, now, 0);
    if (code == SQL_OK) {
      code = run_for(db, drop_subscriptions, s->job, now);
    }
    free(json);
  }
  return code;
}

store_result catalogue_job_subscribe(catalogue *cat, const char *job, const job_webhook *hook) {
  subscribe_arg arg = {.job = job, .hook = hook};
  return catalogue_write(cat, subscribe, &arg);
}

#define COLUMNS                                                                                                    \
  "d.seq, d.job, d.number, d.webhook, d.receiver, d.url, d.type, d.state, d.attempts, d.tried, d.status, d.error," \
  " d.next, d.created, d.ended"

static int read_listed(sql_statement *st, void *to) {
  delivery_row *out = to;
  memset(out, 0, sizeof *out);
  out->seq = sql_integer(st, 0);
  row_text(st, 1, out->job, sizeof out->job);
  out->number = sql_int(st, 2);
  row_text(st, 3, out->webhook, sizeof out->webhook);
  row_text(st, 4, out->receiver, sizeof out->receiver);
  row_text(st, 5, out->url, sizeof out->url);
  row_text(st, 6, out->type, sizeof out->type);
  out->state = (api_delivery_state)sql_int(st, 7);
  out->attempts = sql_int(st, 8);
  out->tried = sql_int(st, 9);
  out->status = sql_int(st, 10);
  row_text(st, 11, out->error, sizeof out->error);
  out->next = sql_integer(st, 12);
  out->created = sql_integer(st, 13);
  out->ended = sql_integer(st, 14);
  return 1;
}

static int read_due(sql_statement *st, void *to) {
  delivery_row *out = to;
  read_listed(st, out);
  out->body = row_copy(st, 15);
  row_text(st, 16, out->secret, sizeof out->secret);
  row_text(st, 17, out->old_secret, sizeof out->old_secret);
  out->old_until = sql_integer(st, 18);
  return out->body != NULL;
}

static void release_row(void *row) {
  delivery_row_free(row);
}
static const row_kind listed_rows = {read_listed, release_row, sizeof(delivery_row)};
static const row_kind due_rows = {read_due, release_row, sizeof(delivery_row)};

int catalogue_deliveries_due(catalogue *cat, int64_t now, int share, int limit, delivery_row *out) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(
      db, "SELECT " COLUMNS
          ", d.body, w.secret, w.old_secret, w.old_until FROM (SELECT name, next,"
          "  row_number() OVER (PARTITION BY tenant ORDER BY next) AS turn FROM receiver WHERE next<=?1) r"
          " JOIN delivery d ON d.seq=(SELECT seq FROM delivery WHERE state=0 AND receiver=r.name AND next<=?1"
          "  ORDER BY next, seq LIMIT 1) LEFT JOIN webhook w ON w.name=d.webhook"
          " WHERE r.turn<=?2 ORDER BY r.turn, r.next LIMIT ?3");
  if (st) {
    sql_bind_integer(st, 1, now);
    sql_bind_integer(st, 2, share);
    sql_bind_integer(st, 3, limit);
  }
  return rows_many(cat, db, st, &due_rows, out, limit);
}

int64_t catalogue_deliveries_next(catalogue *cat) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(db, "SELECT coalesce(min(next), 9223372036854775807) FROM receiver");
  return rows_integer(cat, db, st);
}

int64_t catalogue_deliveries_pending(catalogue *cat) {
  database *db = catalogue_reader(cat);
  return rows_integer(cat, db, database_statement(db, "SELECT count(*) FROM delivery WHERE state=0"));
}

/* A receiver's row follows the first of its pending deliveries. */
static int update_receiver(database *db, const char *receiver) {
  static const char *const steps[] = {
      "DELETE FROM receiver WHERE name=?1 AND NOT EXISTS(SELECT 1 FROM delivery WHERE state=0 AND receiver=?1)",
      "UPDATE receiver SET next=(SELECT min(next) FROM delivery WHERE state=0 AND receiver=?1) WHERE name=?1"};
  int code = SQL_OK;
  for (int i = 0; i < 2 && code == SQL_OK; i++) {
    sql_statement *st = database_statement(db, steps[i]);
    if (st) {
      sql_bind_text(st, 1, receiver);
    }
    code = database_run(db, st);
  }
  return code;
}

typedef struct record_arg {
  const delivery_row *rows;
  int count;
  int64_t now;
} record_arg;

static int record_one(database *db, const delivery_row *row, int64_t now) {
  /* If a delivery was removed or retried by hand in the meantime, it keeps what that has set. */
  sql_statement *st = database_statement(db,
                                         "UPDATE delivery SET state=?2, status=?3, error=?4, next=?5, ended=?6,"
                                         " attempts=attempts+1, tried=tried+1 WHERE seq=?1 AND state=0");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_integer(st, 1, row->seq);
  sql_bind_integer(st, 2, (int)row->state);
  sql_bind_integer(st, 3, row->status);
  sql_bind_text(st, 4, row->error);
  sql_bind_integer(st, 5, row->next);
  sql_bind_integer(st, 6, row->state == API_DELIVERY_PENDING ? 0 : now);
  int code = database_run(db, st);
  /* Its job may have been forgotten in the meantime. */
  st = code == SQL_OK ? database_statement(db,
                                           "DELETE FROM delivery WHERE seq=?1 AND state<>0"
                                           " AND NOT EXISTS(SELECT 1 FROM job WHERE id=delivery.job)")
                      : NULL;
  if (!st) {
    return code == SQL_OK ? SQL_ERROR : code;
  }
  sql_bind_integer(st, 1, row->seq);
  code = database_run(db, st);
  return code == SQL_OK ? update_receiver(db, row->receiver) : code;
}

static int record(database *db, void *arg) {
  const record_arg *r = arg;
  int code = SQL_OK;
  for (int i = 0; i < r->count && code == SQL_OK; i++) {
    code = record_one(db, &r->rows[i], r->now);
  }
  return code;
}

store_result catalogue_deliveries_record(catalogue *cat, const delivery_row *rows, int count, int64_t now) {
  record_arg arg = {.rows = rows, .count = count, .now = now};
  return catalogue_write(cat, record, &arg);
}

int catalogue_deliveries_of(catalogue *cat, const char *job, int limit, delivery_row *out) {
  database *db = catalogue_reader(cat);
  sql_statement *st =
      database_statement(db, "SELECT " COLUMNS " FROM delivery d WHERE d.job=?1 ORDER BY d.number LIMIT ?2");
  if (st) {
    sql_bind_text(st, 1, job);
    sql_bind_integer(st, 2, limit);
  }
  return rows_many(cat, db, st, &listed_rows, out, limit);
}

typedef struct retry_arg {
  const char *job;
  int number;
  int64_t now;
} retry_arg;

static int retry(database *db, void *arg) {
  const retry_arg *r = arg;
  sql_statement *st =
      database_statement(db, "UPDATE delivery SET state=0, tried=0, next=?2, ended=0 WHERE job=?1 AND number=?3");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, r->job);
  sql_bind_integer(st, 2, r->now);
  sql_bind_integer(st, 3, r->number);
  int code = database_run(db, st);
  if (code != SQL_OK || sql_changes(db) == 0) {
    return code == SQL_OK ? SQL_NOTFOUND : code;
  }
  return run_for(db, add_receivers, r->job, r->now);
}

store_result catalogue_delivery_retry(catalogue *cat, const char *job, int number, int64_t now) {
  retry_arg arg = {.job = job, .number = number, .now = now};
  return catalogue_write(cat, retry, &arg);
}
