#include "store/shared.h"

#include <stdlib.h>

#include "store/deliveries.h"
#include "store/rows.h"

/* Estimate of a job's time, charged until the time is known, as queue/schedule.c does within a process. Triggers of
 * postgresql_schema.c charge it (job_claimed) and replace it (job_used, job_ended). */
#define ESTIMATE(job) "(10+" job ".cost/100)"

/* ?1 node, ?2 fetches, ?3 most cost, ?4 big, ?5 alone, ?6 guest, ?7 downloads of an owner, ?8 alone_ms. Owners with
 * ready jobs, each with the first one that fits, in the order of fairness (queue/queue.h). While a suspect waits, one
 * node keeps its workers. The query looks at the first LOOK_AT jobs of each owner only, and where none of them fits, at
 * the LOOK_AT smallest: a claim that finds none must not read a million. The kind is part of the text, so that each
 * kind uses its own index. */
#define LOOK_AT "64"
/* Whether others wait for a job, which is a suspect. */
#define KEEPS(job) "(" job ".suspect=1 AND clock_ms()-" job ".ready<?8)"
#define READY(of_kind) "owner=t.owner AND state=0 AND waits=0 AND " of_kind
#define FITS(which) \
  "(SELECT j.id, j.priority, j.seq, j.keeps FROM"                                         \
  "  (SELECT id, key, priority, seq, " KEEPS("job") "::int AS keeps, cost, big FROM job"  \
  "   WHERE " which " LIMIT " LOOK_AT ") AS j"                                            \
  "  WHERE j.cost<=?3 AND j.big<=?4 AND j.keeps<=?5"                                      \
  "  AND NOT EXISTS(SELECT 1 FROM job o WHERE o.key=j.key AND o.state=1)"                 \
  "  ORDER BY j.priority DESC, j.seq LIMIT 1)"
#define FIRST(of_kind) FITS(READY(of_kind) " ORDER BY priority DESC, seq")
#define SMALLEST(of_kind) FITS(READY(of_kind) " AND cost<=?3 ORDER BY cost")
#define PICK(owners, next) \
  "WITH live AS (SELECT name, workers FROM node WHERE until>=clock_ms() AND workers>0),"                              \
  " busy AS (SELECT owner, count(*) FILTER (WHERE kind<>2) AS computing, count(*) FILTER (WHERE kind=2) AS fetching," \
  "  coalesce(sum(greatest(0, clock_ms()-claimed-" ESTIMATE("job") ")) FILTER (WHERE kind<>2), 0) AS beyond"          \
  "  FROM job WHERE state=1 GROUP BY owner),"                                                                         \
  " share AS (SELECT ceil((SELECT sum(workers) FROM live)::float/greatest(1, (SELECT count(*) FROM"                   \
  "  (SELECT owner FROM turn WHERE ready>0 UNION SELECT owner FROM busy WHERE computing>0) AS active))) AS workers)"  \
  " SELECT next.id FROM turn t LEFT JOIN busy b ON b.owner=t.owner CROSS JOIN share s CROSS JOIN LATERAL"             \
  " (" next ") AS next"                                                                                               \
  " WHERE t.ready>0 AND " owners " AND (?6=0 OR (coalesce(b.computing, 0)=0"                                          \
  "   AND (SELECT sum(computing) FROM busy)>=(SELECT sum(workers) FROM live)))"                                       \
  "  AND (?2=0 OR coalesce(b.fetching, 0)<?7)"                                                                        \
  "  AND (?5=1 OR ?2=1 OR ?6=1 OR ?1<>(SELECT min(name) FROM live)"                                                   \
  "   OR NOT EXISTS(SELECT 1 FROM job k WHERE k.state=0 AND k.waits=0 AND " KEEPS("k") "))"                           \
  " ORDER BY next.keeps DESC, next.priority/8 DESC, (coalesce(b.computing, 0)>=s.workers),"                           \
  "  t.service+coalesce(b.beyond, 0), next.seq LIMIT 1"
#define ANY_COST "9223372036854775807"
/* An owner without a job that is small enough costs one access to the index. The second part of UNION ALL runs only if
 * the first has no row. */
static const char pick_computing[] =
    PICK("(?3=" ANY_COST " OR EXISTS(SELECT 1 FROM job WHERE " READY("kind<>2") " AND cost<=?3))",
         FIRST("kind<>2") " UNION ALL " SMALLEST("kind<>2") " LIMIT 1");
static const char pick_fetching[] = PICK("true", FIRST("kind=2"));

/* Takes the job ?1, which was picked before the transaction: another node may have claimed it since, or a job with its
 * key. Jobs that wait for it are shown as running from now on. All parts see the sums as they were before. */
static const char take[] =
    "WITH taken AS (UPDATE job SET state=1, attempt=attempt+1, node=?2, claimed=clock_ms(),"
    "  alone=CASE WHEN clock_ms()-ready<?3 THEN suspect ELSE 0 END,"
    "  started=CASE WHEN started=0 AND kind<>1 THEN clock_ms() ELSE started END" /* 1: catalogue_job_begin() */
    "  WHERE id=(SELECT id FROM job WHERE id=?1 AND state=0 AND waits=0 FOR UPDATE SKIP LOCKED LIMIT 1)"
    "  AND NOT EXISTS(SELECT 1 FROM job o WHERE o.key=job.key AND o.state=1) RETURNING *),"
    " shown AS (UPDATE job d SET started=clock_ms() FROM taken j JOIN need n ON n.key=j.key AND n.owner=j.owner"
    "  WHERE d.id=n.job AND d.started=0)"
    " SELECT " JOB_COLUMNS
    ", (SELECT coalesce(max(number), 0) FROM event e WHERE e.job=taken.id), big, cancel,"
    " (SELECT sum(ready)-1 FROM turn), (SELECT coalesce(sum(ready), 0) FROM turn WHERE owner<>taken.owner), ready,"
    " request"
    " FROM taken";

typedef struct claim_arg {
  const claim_wish *wish;
  char picked[API_JOB_ID_SIZE];
  job_claim *out;
} claim_arg;

static int step_text(sql_statement *st, char *out, size_t size) {
  int code = sql_step(st);
  if (code == SQL_ROW) {
    row_text(st, 0, out, size);
  }
  sql_reset(st);
  return code == SQL_DONE ? SQL_NOTFOUND : code == SQL_ROW ? SQL_OK : code;
}

static int pick_one(database *db, const claim_wish *w, char id[API_JOB_ID_SIZE]) {
  sql_statement *st = database_statement(db, w->fetches ? pick_fetching : pick_computing);
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, w->node);
  sql_bind_integer(st, 2, w->fetches);
  sql_bind_integer(st, 3, w->most_cost);
  sql_bind_integer(st, 4, w->big);
  sql_bind_integer(st, 5, w->alone);
  sql_bind_integer(st, 6, w->guest);
  sql_bind_integer(st, 7, w->fetches_most);
  sql_bind_integer(st, 8, w->alone_ms);
  return step_text(st, id, API_JOB_ID_SIZE);
}

/* Runs a statement whose parameters ?1 and ?2 are texts. */
static int run_for(database *db, const char *sql, const char *first, const char *second) {
  sql_statement *st = database_statement(db, sql);
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, first);
  sql_bind_text(st, 2, second);
  return database_run(db, st);
}

static int take_one(database *db, const claim_arg *a, const char *id) {
  job_claim *out = a->out;
  sql_statement *st = database_statement(db, take);
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, id);
  sql_bind_text(st, 2, a->wish->node);
  sql_bind_integer(st, 3, a->wish->alone_ms);
  int code = sql_step(st);
  if (code == SQL_ROW) {
    code = job_rows.read(st, &out->row) ? SQL_OK : SQL_NOMEM;
    out->row.request = row_copy(st, 27);
    code = out->row.request ? code : SQL_NOMEM;
    out->last_event = sql_integer(st, 21);
    out->big = sql_int(st, 22);
    out->cancel = sql_int(st, 23);
    out->beside = sql_integer(st, 24);
    out->others = sql_integer(st, 25);
    out->ready = sql_integer(st, 26);
  }
  sql_reset(st);
  if (code == SQL_NOMEM) {
    job_row_free(&out->row);
  }
  return code == SQL_DONE ? SQL_NOTFOUND : code;
}

static int claim_next(database *db, void *arg) {
  const claim_arg *a = arg;
  char id[API_JOB_ID_SIZE];
  job_row_free(&a->out->row); /* of an earlier run of this write */
  memset(a->out, 0, sizeof *a->out);
  memcpy(id, a->picked, sizeof id);
  int code = take_one(db, a, id);
  if (code == SQL_NOTFOUND) {
    code = pick_one(db, a->wish, id);
    code = code == SQL_OK ? take_one(db, a, id) : code;
  }
  return code;
}

/* Picks outside the transaction, for which all nodes wait. The query takes longer than the rest of the claim. */
store_result catalogue_claim_next(catalogue *cat, const claim_wish *wish, job_claim *out) {
  claim_arg a = {.wish = wish, .out = out};
  memset(out, 0, sizeof *out);
  database *db = catalogue_reader(cat);
  int code = pick_one(db, wish, a.picked);
  catalogue_reader_done(cat, db);
  if (code == SQL_NOTFOUND) {
    return STORE_NOT_FOUND;
  }
  if (code != SQL_OK) {
    a.picked[0] = 0; /* the transaction reports it, or picks itself */
  }
  store_result result = catalogue_write(cat, claim_next, &a);
  if (result != STORE_OK) {
    job_row_free(&out->row);
  }
  return result;
}

static int find_same(database *db, const char *key, const char *owner, char id[API_JOB_ID_SIZE]) {
  sql_statement *st = database_statement(
      db, "SELECT id FROM job WHERE key=?1 AND owner=?2 AND state<2 AND cancel=0 ORDER BY seq LIMIT 1");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, key);
  sql_bind_text(st, 2, owner);
  return step_text(st, id, API_JOB_ID_SIZE);
}

static int adopt(database *db, const job_submission *s) {
  sql_statement *st =
      database_statement(db, "UPDATE job SET listed=greatest(listed, ?2), priority=greatest(priority, ?3) WHERE id=?1");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, s->row->id);
  sql_bind_integer(st, 2, s->row->listed);
  sql_bind_integer(st, 3, s->row->priority);
  return database_run(db, st);
}

static int check_limits(database *db, job_submission *s) {
  sql_statement *st = database_statement(
      db,
      "SELECT coalesce(sum(unfinished), 0), coalesce(sum(listed) FILTER (WHERE owner=?1), 0),"
      " coalesce(sum(computing) FILTER (WHERE owner=?1), 0), coalesce(sum(cost) FILTER (WHERE owner=?1), 0),"
      " coalesce((SELECT requests FROM tenant WHERE name=?1), 0) FROM turn");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, s->row->owner);
  int code = sql_step(st);
  if (code == SQL_ROW) {
    const int64_t pending = s->head * sql_integer(st, 2) + s->triangle * sql_integer(st, 3) + sql_integer(st, 4);
    const int64_t room = s->room ? *s->room - pending : 0;
    s->outcome = s->row->listed && sql_integer(st, 0) >= s->limit             ? SUBMIT_FULL
                 : s->owner_limit > 0 && sql_integer(st, 1) >= s->owner_limit ? SUBMIT_QUOTA
                 : s->room && room < s->needs                                 ? SUBMIT_ROOM
                                                                              : SUBMIT_FRESH;
    if (s->outcome == SUBMIT_ROOM || s->outcome == SUBMIT_FRESH) {
      if (s->room) {
        *s->room = room;
      }
    }
  }
  sql_reset(st);
  return code == SQL_ROW ? SQL_OK : code;
}

typedef struct submit_arg {
  job_submission *submission;
  int64_t room;
  char id[API_JOB_ID_SIZE]; /* of a fresh one */
} submit_arg;

static int submit(database *db, void *arg) {
  submit_arg *a = arg;
  job_submission *s = a->submission;
  job_row *r = s->row;
  memcpy(r->id, a->id, sizeof r->id); /* this may be the second run */
  if (s->room) {
    *s->room = a->room;
  }
  int code = find_same(db, r->key, r->owner, r->id);
  if (code == SQL_OK) {
    s->outcome = SUBMIT_KNOWN;
    code = adopt(db, s);
    return code == SQL_OK && s->hook ? delivery_subscribe(db, r->id, s->hook) : code;
  }
  memcpy(r->id, a->id, sizeof r->id);
  code = code == SQL_NOTFOUND ? check_limits(db, s) : code;
  return code == SQL_OK && s->outcome == SUBMIT_FRESH ? job_insert(db, r, s->hook) : code;
}

store_result catalogue_job_submit(catalogue *cat, job_submission *s) {
  submit_arg a = {.submission = s, .room = s->room ? *s->room : 0};
  memcpy(a.id, s->row->id, sizeof a.id);
  s->outcome = SUBMIT_FRESH;
  return catalogue_write(cat, submit, &a);
}

static int need_one(database *db, const job_needs *n, int i) {
  char id[API_JOB_ID_SIZE];
  job_row row = {.kind = API_JOB_EMBEDDING, .priority = n->row->priority, .cost = n->costs[i], .created = n->now};
  int code = find_same(db, n->keys[i], n->row->owner, id);
  if (code == SQL_NOTFOUND) {
    api_random_id(row.id);
    memcpy(row.key, n->keys[i], sizeof row.key);
    memcpy(row.owner, n->row->owner, sizeof row.owner);
    memcpy(row.charged, n->row->charged, sizeof row.charged);
    memcpy(row.trace, n->row->trace, sizeof row.trace);
    row.request = (char *)(uintptr_t)n->requests[i];
    code = job_insert(db, &row, NULL);
  }
  sql_statement *st = code == SQL_OK ? database_statement(db,
                                                          "INSERT INTO need(job, key, owner) VALUES(?1, ?2, ?3)"
                                                          " ON CONFLICT DO NOTHING")
                                     : NULL;
  if (st) {
    sql_bind_text(st, 1, n->row->id);
    sql_bind_text(st, 2, n->keys[i]);
    sql_bind_text(st, 3, n->row->owner);
    code = database_run(db, st);
  }
  return code;
}

static int change_claimed(database *db, const char *sql, const char *id, int attempt) {
  sql_statement *st = database_statement(db, sql);
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, id);
  sql_bind_integer(st, 2, attempt);
  int code = database_run(db, st);
  return code == SQL_OK && sql_changes(db) != 1 ? SQL_CONSTRAINT : code;
}

static int wait_for(database *db, void *arg) {
  const job_needs *n = arg;
  int code = SQL_OK;
  for (int i = 0; i < n->count && code == SQL_OK; i++) {
    code = need_one(db, n, i);
  }
  return code == SQL_OK ? change_claimed(db,
                                         "UPDATE job SET state=0, attempt=attempt-1, alone=0,"
                                         " waits=(SELECT count(*) FROM need WHERE need.job=?1),"
                                         " started=CASE WHEN EXISTS(SELECT 1 FROM need n JOIN job e ON e.key=n.key"
                                         " AND e.owner=n.owner WHERE n.job=?1 AND e.state=1)"
                                         " THEN CASE job.started WHEN 0 THEN clock_ms() ELSE job.started END"
                                         " WHEN job.attempt>1 THEN job.started ELSE 0 END"
                                         " WHERE id=?1 AND state=1 AND attempt=?2 AND cancel=0",
                                         n->row->id, n->row->attempt)
                        : code;
}

store_result catalogue_job_wait(catalogue *cat, const job_needs *needs) {
  return catalogue_write(cat, wait_for, (void *)(uintptr_t)needs);
}

static int begin(database *db, void *arg) {
  const job_row *r = arg;
  sql_statement *st =
      database_statement(db, "UPDATE job SET started=clock_ms() WHERE id=?1 AND state=1 AND attempt=?2 AND started=0");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, r->id);
  sql_bind_integer(st, 2, r->attempt);
  return database_run_later(db, st, SQL_ANY);
}

void catalogue_job_begin(catalogue *cat, const char *id, int attempt) {
  job_row *row = calloc(1, sizeof *row);
  if (row) {
    row->attempt = attempt;
    snprintf(row->id, sizeof row->id, "%s", id);
    catalogue_write_gathered(cat, begin, row);
  }
}

static int release_big(database *db, void *arg) {
  const job_row *r = arg;
  return change_claimed(db,
                        "UPDATE job SET state=0, attempt=attempt-1, alone=0, big=1"
                        " WHERE id=?1 AND state=1 AND attempt=?2",
                        r->id, r->attempt);
}

store_result catalogue_job_release_big(catalogue *cat, const char *id, int attempt) {
  job_row row = {.attempt = attempt};
  snprintf(row.id, sizeof row.id, "%s", id);
  return catalogue_write(cat, release_big, &row);
}

static int cancel(database *db, void *arg) {
  return run_for(db, "UPDATE job SET cancel=1 WHERE id=?1 AND state<2", arg, NULL);
}

store_result catalogue_job_cancel(catalogue *cat, const char *id) {
  return catalogue_write(cat, cancel, (void *)(uintptr_t)id);
}

static int read_mark(sql_statement *st, void *to) {
  job_mark *out = to;
  row_text(st, 0, out->id, sizeof out->id);
  out->state = sql_int(st, 1);
  out->attempt = sql_int(st, 2);
  out->cancel = sql_int(st, 3);
  out->last_event = sql_integer(st, 4);
  out->queued = sql_int(st, 5);
  return 1;
}
static const row_kind mark_rows = {read_mark, NULL, sizeof(job_mark)};

int catalogue_job_marks(catalogue *cat, const char *ids, int limit, job_mark *out) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(
      db, "SELECT id, " JOB_STATE_SHOWN
          ", attempt,"
          " cancel, (SELECT coalesce(max(number), 0) FROM event e"
          " WHERE e.job=job.id), (state=0)::int FROM job WHERE id=ANY(string_to_array(?1, ',')) LIMIT ?2");
  if (st) {
    sql_bind_text(st, 1, ids);
    sql_bind_integer(st, 2, limit);
  }
  return rows_many(cat, db, st, &mark_rows, out, limit);
}

int catalogue_lost_jobs(catalogue *cat, int64_t lease_ms) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(
      db,
      "SELECT count(*) FROM job WHERE state=1 AND node NOT IN (SELECT name FROM node WHERE until>=clock_ms())"
      " AND pg_postmaster_start_time()<clock_timestamp()-make_interval(secs => ?1/1000.0)");
  if (st) {
    sql_bind_integer(st, 1, lease_ms);
  }
  return rows_integer(cat, db, st) > 0;
}

static int read_numbers(sql_statement *st, void *to) {
  shared_numbers *out = to;
  int64_t *const all[] = {&out->ready,  &out->unfinished, &out->waiting, &out->running,
                          &out->oldest, &out->nodes,      &out->workers};
  for (int i = 0; i < 7; i++) {
    *all[i] = sql_integer(st, i);
  }
  return 1;
}
static const row_kind number_rows = {read_numbers, NULL, sizeof(shared_numbers)};

store_result catalogue_shared_numbers(catalogue *cat, shared_numbers *out) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(
      db,
      "SELECT coalesce(sum(ready), 0), coalesce(sum(unfinished), 0), (SELECT count(DISTINCT job) FROM need),"
      " (SELECT count(*) FROM job WHERE state=1),"
      " coalesce((SELECT created FROM job WHERE state=0 ORDER BY seq LIMIT 1), 0),"
      " (SELECT count(*) FROM node WHERE until>=clock_ms()),"
      " (SELECT coalesce(sum(workers), 0) FROM node WHERE until>=clock_ms()) FROM turn");
  return rows_one(cat, db, st, &number_rows, out);
}

store_result catalogue_shared_of(catalogue *cat, const char *owner, int64_t *running, int64_t *queued) {
  database *db = catalogue_reader(cat);
  shared_numbers found = {0};
  sql_statement *st = database_statement(
      db,
      "SELECT 0, coalesce(sum(unfinished), 0), 0, (SELECT count(*) FROM job WHERE state=1 AND owner=?1), 0, 0, 0"
      " FROM turn WHERE owner=?1");
  if (st) {
    sql_bind_text(st, 1, owner);
  }
  store_result result = rows_one(cat, db, st, &number_rows, &found);
  *running = found.running;
  *queued = found.unfinished - found.running;
  return result;
}

int catalogue_maintain(catalogue *cat) {
  if (!database_is_url(catalogue_path(cat))) {
    return 1;
  }
  database *db = catalogue_reader(cat);
  database_execute(db, "SET statement_timeout=0"); /* a thread that runs alone always gets this reader */
  if (!catalogue_is_shared(cat)) {
    catalogue_reader_done(cat, db);
    return 1;
  }
  sql_statement *st = database_statement(db, "SELECT pg_try_advisory_lock(?1::int, hashtext(current_schema()))::int");
  if (st) {
    sql_bind_integer(st, 1, SQL_LOCK_MAINTAIN);
  }
  return rows_integer(cat, db, st) != 0; /* if the database cannot be asked, the caller's next question fails as well */
}

int catalogue_needs_mesh(catalogue *cat, const char *mesh, const char *owner) {
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(db,
                                         "SELECT count(*) FROM (SELECT 1 FROM job WHERE state<2"
                                         " AND strpos(request, ?1)>0 AND (?2 IS NULL OR owner=?2) LIMIT 1) AS named");
  if (st) {
    sql_bind_text(st, 1, mesh);
    sql_bind_text(st, 2, owner);
  }
  return rows_integer(cat, db, st) != 0; /* if the rows cannot be read, assume that one does */
}

char *catalogue_failure(catalogue *cat, const char *key, const char *owner, int64_t since) {
  database *db = catalogue_reader(cat);
  job_row row = {0};
  sql_statement *st = database_statement(db, "SELECT " JOB_COLUMNS
                                             " FROM job WHERE key=?1 AND owner=?2 AND state>=2 AND finished>?3"
                                             " ORDER BY finished DESC LIMIT 1");
  if (st) {
    sql_bind_text(st, 1, key);
    sql_bind_text(st, 2, owner);
    sql_bind_integer(st, 3, since);
  }
  char *problem = NULL;
  if (rows_one(cat, db, st, &job_rows, &row) == STORE_OK) {
    problem = row.state == API_JOB_FAILED ? row.problem : NULL;
    row.problem = problem ? NULL : row.problem;
    job_row_free(&row);
  }
  return problem;
}
