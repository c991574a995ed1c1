/* The jobs of several nodes in PostgreSQL: claims in the order of fairness, leases, fencing, one flight a key, what
 * jobs wait for. Two catalogues on one schema stand for two nodes. Runs under tests/tools/with_postgresql.sh. */
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "store/notices.h"
#include "store/object_lock.h"
#include "store/owners.h"
#include "store/shared.h"
#include "store/transactions.h"

typedef struct nodes {
  char url[256];
  catalogue *cat[2];
  notices *bell[2];
} nodes;

static const char *const names[2] = {"11111111111111111111111111111111", "22222222222222222222222222222222"};
enum { LEASE_MS = 300 };

static int setup(void **state) {
  static int count;
  nodes *n = calloc(1, sizeof *n);
  char command[256];
  snprintf(command, sizeof command, "%s shared-%d-%d", getenv("ORB_NEW_CATALOGUE"), (int)getpid(), ++count);
  FILE *out = popen(command, "r");
  int fine = out && fgets(n->url, sizeof n->url, out);
  if (!out || pclose(out) != 0 || !fine) {
    return -1;
  }
  for (int i = 0; i < 2; i++) {
    int fresh;
    if (catalogue_open_shared(n->url, 1, &n->cat[i]) != STORE_OK || !(n->bell[i] = notices_open(n->url)) ||
        !notices_connect(n->bell[i], &fresh) || !notices_renew(n->bell[i], names[i], 1, 60000)) {
      return -1;
    }
  }
  *state = n;
  return 0;
}

static int teardown(void **state) {
  nodes *n = *state;
  for (int i = 0; i < 2; i++) {
    catalogue_close(n->cat[i]);
    notices_close(n->bell[i]);
  }
  free(n);
  return 0;
}

static void fill(char *out, char digit) {
  memset(out, digit, API_ID_SIZE - 1);
  out[API_ID_SIZE - 1] = 0;
}

/* Submits a job whose key has this digit. */
static submit_outcome submit(nodes *n, int node, const char *owner, char key, int priority, job_row *row) {
  *row = (job_row){.kind = API_JOB_EMBEDDING, .listed = 1, .cost = 12, .priority = priority, .created = 1};
  row->request = (char *)(uintptr_t) "{}";
  fill(row->key, key);
  api_random_id(row->id);
  snprintf(row->owner, sizeof row->owner, "%s", owner);
  job_submission s = {.row = row, .limit = 100};
  assert_int_equal(catalogue_job_submit(n->cat[node], &s), STORE_OK);
  return s.outcome;
}

static store_result claim_costing(nodes *n, int node, int64_t most, job_claim *out) {
  const claim_wish wish = {.node = names[node], .most_cost = most, .big = 1, .alone = 1, .fetches_most = 4};
  store_result result = catalogue_claim_next(n->cat[node], &wish, out);
  if (result == STORE_OK) {
    free(out->row.request);
    free(out->row.problem);
    out->row.request = out->row.problem = NULL;
  }
  return result;
}

static store_result claim(nodes *n, int node, job_claim *out) {
  return claim_costing(n, node, INT64_MAX, out);
}

static store_result finish(nodes *n, int node, const job_claim *c, api_job_state state, const char *problem) {
  const job_end end = {
      .state = state, .problem = problem, .now = 5, .event = 5, .event_json = "{}", .owner = c->row.owner};
  return catalogue_job_finish(n->cat[node], c->row.id, c->row.attempt, &end);
}

/* A job that fails leaves no result to be owned. */
static void end(nodes *n, int node, const job_claim *c) {
  assert_int_equal(finish(n, node, c, API_JOB_FAILED, "{}"), STORE_OK);
}

static void test_order(void **state) {
  nodes *n = *state;
  job_row rows[6];
  job_claim c;
  submit(n, 0, "ann", '1', 0, &rows[0]);
  submit(n, 0, "ann", '2', 3, &rows[1]); /* more urgent */
  submit(n, 1, "bob", '3', 0, &rows[2]);
  submit(n, 1, "eve", '4', 8, &rows[3]); /* of a higher class */
  const int order[] = {3, 1, 2, 0};      /* class, ann's most urgent; then bob, who had nothing yet; then ann again */
  for (int i = 0; i < 4; i++) {
    assert_int_equal(claim(n, i % 2, &c), STORE_OK);
    assert_string_equal(c.row.id, rows[order[i]].id);
    assert_int_equal(c.row.attempt, 1);
    assert_int_equal(c.row.state, API_JOB_RUNNING);
  }
  assert_int_equal(claim(n, 0, &c), STORE_NOT_FOUND);
}

static int began_earlier(database *db, void *ms) {
  sql_statement *st = database_statement(db, "UPDATE job SET claimed=claimed-?1 WHERE state=1");
  sql_bind_integer(st, 1, *(const int64_t *)ms);
  return database_run(db, st);
}

/* Ends a job that its worker has had for so long. */
static void end_after(nodes *n, int node, const job_claim *c, int64_t ms) {
  assert_int_equal(catalogue_write(n->cat[node], began_earlier, &ms), STORE_OK);
  end(n, node, c);
}

/* Claims a job, which must be of this owner. */
static void claim_of(nodes *n, int node, const char *owner, job_claim *c) {
  assert_int_equal(claim(n, node, c), STORE_OK);
  assert_string_equal(c->row.owner, owner);
}

/* Turns go by the time that jobs took, not by what was estimated: both owners' jobs have the same cost. */
static void test_time_counts(void **state) {
  enum { MINUTE = 60000 };
  nodes *n = *state;
  job_row row;
  job_claim c;
  for (char key = '0'; key < '3'; key++) {
    submit(n, 0, "ann", key, 0, &row);
    submit(n, 1, "bob", (char)(key + 3), 0, &row);
  }
  claim_of(n, 0, "ann", &c);
  end_after(n, 0, &c, 60 * MINUTE);
  for (int i = 0; i < 3; i++) { /* ann waits until bob has had an hour too */
    claim_of(n, i % 2, "bob", &c);
    end_after(n, i % 2, &c, 20 * MINUTE + i * MINUTE);
  }
  claim_of(n, 1, "ann", &c);
  end_after(n, 1, &c, MINUTE);
  claim_of(n, 0, "ann", &c);
}

/* An owner that comes while a job of another has run for an hour is not an hour ahead. */
static void test_start_level(void **state) {
  enum { MINUTE = 60000 };
  int64_t hour = 60 * MINUTE;
  nodes *n = *state;
  job_row row;
  job_claim long_one, c;
  submit(n, 0, "ann", '1', 0, &row);
  submit(n, 0, "ann", '2', 0, &row);
  claim_of(n, 0, "ann", &long_one);
  assert_int_equal(catalogue_write(n->cat[0], began_earlier, &hour), STORE_OK);
  submit(n, 1, "bob", '3', 0, &row);
  submit(n, 1, "bob", '4', 0, &row);
  end_after(n, 0, &long_one, MINUTE);
  claim_of(n, 1, "bob", &c); /* who began level with ann, when she had used an hour */
  end_after(n, 1, &c, 2 * MINUTE);
  claim_of(n, 1, "ann", &c);
}

/* A worker that is kept for small jobs finds one behind any number of large ones. */
static void test_small_behind_large(void **state) {
  enum { LARGE_JOBS = 90, LARGE_COST = 1000000, SMALL_COST = 10 };
  nodes *n = *state;
  job_row row = {.kind = API_JOB_EMBEDDING, .listed = 1, .created = 1, .owner = "ann"};
  char small[2][API_JOB_ID_SIZE];
  job_claim c;
  row.request = (char *)(uintptr_t) "{}";
  for (int i = 0; i < LARGE_JOBS + 2; i++) {
    row.cost = i < LARGE_JOBS ? LARGE_COST : SMALL_COST;
    snprintf(row.key, sizeof row.key, "%064x", (unsigned)i);
    api_random_id(row.id);
    job_submission s = {.row = &row, .limit = 100};
    assert_int_equal(catalogue_job_submit(n->cat[0], &s), STORE_OK);
    assert_int_equal(s.outcome, SUBMIT_FRESH);
    if (i >= LARGE_JOBS) {
      memcpy(small[i - LARGE_JOBS], row.id, sizeof small[0]);
    }
  }
  for (int i = 0; i < 2; i++) {
    assert_int_equal(claim_costing(n, 1, SMALL_COST, &c), STORE_OK);
    assert_string_equal(c.row.id, small[i]);
  }
  assert_int_equal(claim_costing(n, 1, SMALL_COST, &c), STORE_NOT_FOUND);
  assert_int_equal(claim(n, 0, &c), STORE_OK);
  assert_int_equal(c.row.cost, LARGE_COST);
}

static void test_one_flight(void **state) {
  nodes *n = *state;
  job_row first, again, other;
  job_claim a, b;
  assert_int_equal(submit(n, 0, "ann", '1', 0, &first), SUBMIT_FRESH);
  assert_int_equal(submit(n, 1, "ann", '1', 0, &again), SUBMIT_KNOWN);
  assert_string_equal(again.id, first.id);
  assert_int_equal(submit(n, 1, "bob", '1', 0, &other), SUBMIT_FRESH);
  assert_int_equal(claim(n, 0, &a), STORE_OK);
  assert_int_equal(claim(n, 1, &b), STORE_NOT_FOUND); /* the same key */
  end(n, 0, &a);
  assert_int_equal(claim(n, 1, &b), STORE_OK);
  assert_string_equal(b.row.id, other.id);
}

static void test_limits(void **state) {
  nodes *n = *state;
  job_row row;
  int64_t room = 1000;
  submit(n, 0, "ann", '1', 0, &row);
  row.request = (char *)(uintptr_t) "{}";
  fill(row.key, '2');
  job_submission s = {.row = &row, .limit = 1};
  assert_int_equal(catalogue_job_submit(n->cat[1], &s), STORE_OK);
  assert_int_equal(s.outcome, SUBMIT_FULL);
  s = (job_submission){.row = &row, .limit = 9, .owner_limit = 1};
  assert_int_equal(catalogue_job_submit(n->cat[1], &s), STORE_OK);
  assert_int_equal(s.outcome, SUBMIT_QUOTA);
  s = (job_submission){.row = &row, .limit = 9, .room = &room, .head = 40, .triangle = 40}; /* 40 + 12 * 40 each */
  assert_int_equal(catalogue_job_submit(n->cat[1], &s), STORE_OK);
  assert_int_equal(s.outcome, SUBMIT_ROOM);
  assert_int_equal(room, 480);
}

/* What a node ran that is silent beyond its lease, another one runs; the first one can then neither end nor release it.
 */
static void test_lease(void **state) {
  nodes *n = *state;
  job_row row, got;
  job_claim lost, taken;
  submit(n, 0, "ann", '1', 0, &row);
  assert_int_equal(claim(n, 0, &lost), STORE_OK);
  assert_false(catalogue_lost_jobs(n->cat[1], LEASE_MS)); /* its lease is a minute */
  assert_true(notices_renew(n->bell[0], names[0], 1, LEASE_MS));
  while (!catalogue_lost_jobs(n->cat[1], LEASE_MS)) {
    usleep(20000);
  }
  catalogue_recover_lost(n->cat[1], 3, 7, "{}");
  assert_int_equal(claim(n, 1, &taken), STORE_OK); /* after that write */
  assert_string_equal(taken.row.id, row.id);
  assert_int_equal(taken.row.attempt, 2);
  assert_int_equal(taken.row.suspect, 1);
  assert_int_equal(taken.row.crashes, 0); /* it did not run alone */
  assert_int_equal(finish(n, 0, &lost, API_JOB_FAILED, "{\"late\":1}"), STORE_CONFLICT);
  assert_int_equal(catalogue_job_release(n->cat[0], row.id, lost.row.attempt), STORE_CONFLICT);
  end(n, 1, &taken);
  assert_int_equal(catalogue_job_get(n->cat[0], row.id, &got), STORE_OK);
  assert_string_equal(got.problem, "{}");
  job_row_free(&got);
}

/* The third node that falls silent while the job runs alone ends it. */
static void test_crashes(void **state) {
  nodes *n = *state;
  job_row row, got;
  job_claim c;
  submit(n, 0, "ann", '1', 0, &row);
  for (int death = 0; death < 4; death++) {
    assert_int_equal(claim(n, 0, &c), STORE_OK);
    assert_int_equal(c.row.alone, death > 0);
    assert_true(notices_renew(n->bell[0], names[0], 1, 0));
    while (!catalogue_lost_jobs(n->cat[1], LEASE_MS)) {
      usleep(20000);
    }
    catalogue_recover_lost(n->cat[1], 3, 7, "{\"crashed\":1}");
    assert_int_equal(catalogue_job_cancel(n->cat[1], "none"), STORE_OK); /* waits for that write */
    assert_true(notices_renew(n->bell[0], names[0], 1, 60000));
  }
  assert_int_equal(catalogue_job_get(n->cat[0], row.id, &got), STORE_OK);
  assert_int_equal(got.state, API_JOB_FAILED);
  assert_string_equal(got.problem, "{\"crashed\":1}");
  job_row_free(&got);
  assert_int_equal(claim(n, 0, &c), STORE_NOT_FOUND);
}

static void test_own_last_life(void **state) {
  nodes *n = *state;
  job_row row;
  job_claim c;
  submit(n, 0, "ann", '1', 0, &row);
  submit(n, 0, "ann", '2', 0, &row);
  assert_int_equal(claim(n, 0, &c), STORE_OK);
  assert_int_equal(claim(n, 1, &c), STORE_OK);
  assert_int_equal(catalogue_recover_own(n->cat[0], names[0]), STORE_OK);
  assert_int_equal(claim(n, 1, &c), STORE_OK);
  assert_int_equal(c.row.suspect, 0);
  assert_int_equal(claim(n, 1, &c), STORE_NOT_FOUND); /* what the other node runs stays */
}

static int is_waiting(nodes *n, const char *id, job_mark *mark) {
  assert_int_equal(catalogue_job_marks(n->cat[1], id, 1, mark), 1);
  return mark->queued;
}

/* The first node's job of this row waits for one whose key has digit 2. */
static store_result wait_for_2(nodes *n, const job_row *row) {
  char keys[1][API_ID_SIZE];
  const char *const requests[] = {"{}"};
  const int64_t costs[] = {5};
  fill(keys[0], '2');
  const job_needs needs = {.row = row, .keys = keys, .requests = requests, .costs = costs, .count = 1};
  return catalogue_job_wait(n->cat[0], &needs);
}

/* Claims a job whose key has this digit. */
static void claim_key(nodes *n, int node, char digit, job_claim *out) {
  char key[API_ID_SIZE];
  fill(key, digit);
  assert_int_equal(claim(n, node, out), STORE_OK);
  assert_string_equal(out->row.key, key);
}

static void test_needs(void **state) {
  nodes *n = *state;
  job_row row;
  job_claim whole, part;
  job_mark mark;
  submit(n, 0, "ann", '1', 0, &row);
  claim_key(n, 0, '1', &whole);
  assert_int_equal(wait_for_2(n, &whole.row), STORE_OK);
  assert_true(is_waiting(n, row.id, &mark));
  assert_int_equal(mark.state, API_JOB_QUEUED);
  assert_int_equal(mark.attempt, 0); /* that attempt does not count */
  claim_key(n, 1, '2', &part);
  assert_true(is_waiting(n, row.id, &mark));
  assert_int_equal(mark.state, API_JOB_RUNNING); /* as callers see it */
  job_claim none;
  assert_int_equal(claim(n, 0, &none), STORE_NOT_FOUND);
  end(n, 1, &part);
  assert_int_equal(claim(n, 0, &whole), STORE_OK);
  assert_string_equal(whole.row.id, row.id);
  assert_int_equal(whole.row.attempt, 1);
}

/* A supermesh is claimed to see what it lacks: callers see it run once it has begun, or once what it lacks runs. */
static void test_begin(void **state) {
  nodes *n = *state;
  job_row row = {.kind = API_JOB_SUPERMESH, .listed = 1, .cost = 12, .created = 1, .owner = "ann"};
  job_claim whole;
  job_mark mark;
  row.request = (char *)(uintptr_t) "{}";
  fill(row.key, '1');
  api_random_id(row.id);
  job_submission s = {.row = &row, .limit = 100};
  assert_int_equal(catalogue_job_submit(n->cat[0], &s), STORE_OK);
  claim_key(n, 0, '1', &whole);
  assert_false(is_waiting(n, row.id, &mark));
  assert_int_equal(mark.state, API_JOB_QUEUED);
  assert_int_equal(whole.row.started, 0);
  assert_int_equal(catalogue_job_begin(n->cat[0], row.id, whole.row.attempt + 1), STORE_OK); /* another claim's */
  assert_false(is_waiting(n, row.id, &mark));
  assert_int_equal(mark.state, API_JOB_QUEUED);
  assert_int_equal(catalogue_job_begin(n->cat[0], row.id, whole.row.attempt), STORE_OK);
  assert_false(is_waiting(n, row.id, &mark));
  assert_int_equal(mark.state, API_JOB_RUNNING);
}

/* Cancelling a job that waits also cancels the jobs that it alone needs. */
static void test_cancel(void **state) {
  nodes *n = *state;
  job_row row;
  job_claim whole, part;
  submit(n, 0, "ann", '1', 0, &row);
  claim_key(n, 0, '1', &whole);
  assert_int_equal(wait_for_2(n, &whole.row), STORE_OK);
  assert_int_equal(catalogue_job_cancel(n->cat[1], row.id), STORE_OK);
  whole.row.attempt = 0;
  assert_int_equal(finish(n, 1, &whole, API_JOB_CANCELLED, NULL), STORE_OK);
  claim_key(n, 1, '2', &part);
  assert_true(part.cancel);
  submit(n, 0, "ann", '3', 0, &row);
  claim_key(n, 0, '3', &whole);
  assert_int_equal(catalogue_job_cancel(n->cat[1], row.id), STORE_OK);
  assert_int_equal(wait_for_2(n, &whole.row), STORE_CONFLICT);
}

static void note(void *user, const char *text) {
  char *heard = user;
  if (text[0] == heard[0]) {
    heard[1]++;
  }
}

static void test_notices(void **state) {
  nodes *n = *state;
  job_row row;
  job_claim c;
  char queued[2] = {'q', 0}, changed[2] = {'j', 0};
  submit(n, 0, "ann", '1', 0, &row);
  for (int i = 0; i < 100 && !queued[1]; i++) {
    notices_wait(n->bell[1], 100, note, queued);
  }
  assert_int_equal(queued[1], 1);
  assert_int_equal(claim(n, 0, &c), STORE_OK);
  end(n, 0, &c);
  for (int i = 0; i < 100 && changed[1] < 2; i++) {
    notices_wait(n->bell[1], 100, note, changed);
  }
  assert_int_equal(changed[1], 2);
  assert_true(notices_does_housekeeping(n->bell[0]));
  assert_false(notices_does_housekeeping(n->bell[1]));
}

static store_result put_mesh(nodes *n, char digit) {
  char json[] = "{}";
  int fresh;
  resource row = {.kind = RESOURCE_MESH, .json = json, .bytes = 1, .created = 1};
  fill(row.id, digit);
  fill(row.sha, digit);
  return catalogue_put_for(n->cat[0], &row, "", 0, &fresh);
}

static int has_mesh(nodes *n, char digit) {
  char id[API_ID_SIZE];
  resource row = {0};
  fill(id, digit);
  store_result found = catalogue_get(n->cat[1], RESOURCE_MESH, id, &row);
  resource_free(&row);
  return found == STORE_OK;
}

/* The first column of a query that takes the class of an advisory lock. */
static int64_t ask_of_lock(nodes *n, const char *sql, int class) {
  database *db = catalogue_reader(n->cat[1]);
  sql_statement *st = database_statement(db, sql);
  assert_non_null(st);
  sql_bind_integer(st, 1, class);
  assert_int_equal(sql_step(st), SQL_ROW);
  int64_t value = sql_integer(st, 0);
  sql_reset(st);
  catalogue_reader_done(n->cat[1], db);
  return value;
}

/* Cuts the connections that have the lock of objects, and waits until the server has dropped it. */
static void cut_lock(nodes *n) {
  assert_int_equal(ask_of_lock(n,
                               "SELECT count(pg_terminate_backend(pid, 60000)) FROM pg_locks WHERE locktype='advisory' "
                               "AND classid=?1::oid AND objsubid=2",
                               SQL_LOCK_OBJECTS),
                   1);
}

/* Sets for how many ms the announcement stands. */
static int set_until(database *db, void *argument) {
  char sql[80];
  snprintf(sql, sizeof sql, "UPDATE deletion SET until=clock_ms()+%lld", (long long)*(const int64_t *)argument);
  return database_execute(db, sql);
}

static void test_publishing(void **state) {
  nodes *n = *state;
  object_lock *here = object_lock_open(n->url), *there = object_lock_open(n->url);
  assert_true(here && there);
  assert_int_equal(put_mesh(n, '0'), STORE_OK); /* of no objects */
  assert_true(object_lock_share(here));
  assert_int_equal(put_mesh(n, '1'), STORE_OK);
  cut_lock(n);
  assert_int_equal(put_mesh(n, '2'), STORE_LOST);
  assert_true(object_lock_exclude(there)); /* what was published may be deleted now */
  object_lock_let_go(there);
  assert_int_equal(put_mesh(n, '2'), STORE_LOST);
  object_lock_unshare(here);
  assert_false(has_mesh(n, '2'));
  assert_true(object_lock_share(here)); /* published again */
  assert_int_equal(put_mesh(n, '2'), STORE_OK);
  object_lock_unshare(here);
  object_lock_close(here);
  object_lock_close(there);
}

/* A node that lost the lock after it had announced a deletion: its request may come to S3 late. Whoever publishes waits
 * for that, and a node without the lock announces nothing. */
static void test_announced_deletion(void **state) {
  enum { LEFT_MS = 400 };
  nodes *n = *state;
  object_lock *here = object_lock_open(n->url), *there = object_lock_open(n->url);
  assert_true(here && there);
  assert_true(object_lock_exclude(here));
  assert_true(object_lock_announce(here));
  object_lock_let_go(here); /* S3 has answered */
  assert_int_equal(ask_of_lock(n, "SELECT count(*) FROM deletion WHERE ?1<>0", 1), 0);
  assert_true(object_lock_exclude(here));
  assert_true(object_lock_announce(here));
  object_lock_keep_announced(here); /* S3 has not answered this one, but the next */
  assert_true(object_lock_announce(here));
  object_lock_let_go(here);
  assert_true(object_lock_exclude(here));
  assert_true(ask_of_lock(n, "SELECT until-clock_ms() FROM deletion WHERE ?1<>0", 1) > OBJECT_LOCK_DELETES_MS / 2);
  cut_lock(n);
  assert_false(object_lock_announce(here));
  assert_int_equal(catalogue_write(n->cat[0], set_until, &(int64_t){LEFT_MS}), STORE_OK); /* to wait less */
  assert_true(object_lock_share(there));
  assert_int_equal(ask_of_lock(n, "SELECT count(*) FROM deletion WHERE until>=clock_ms() AND ?1<>0", 1), 0);
  assert_int_equal(put_mesh(n, '1'), STORE_OK);
  object_lock_unshare(there);
  object_lock_let_go(here);
  object_lock_close(here);
  object_lock_close(there);
}

typedef struct publisher {
  nodes *n;
  object_lock *lock;
  char digit;
  store_result stored;
} publisher;

static void *publish(void *argument) {
  publisher *p = argument;
  object_lock_share(p->lock);
  p->stored = put_mesh(p->n, p->digit);
  object_lock_unshare(p->lock);
  return NULL;
}

/* A thread that begins to share after the lock was lost takes it for itself, not for those before it. */
static void test_publishing_together(void **state) {
  nodes *n = *state;
  object_lock *lock = object_lock_open(n->url);
  publisher other = {.n = n, .lock = lock, .digit = '1', .stored = STORE_ERROR};
  pthread_t thread;
  assert_true(object_lock_share(lock));
  for (int lost = 0; lost < 2; lost++, other.digit++) {
    if (lost) {
      cut_lock(n);
    }
    assert_int_equal(pthread_create(&thread, NULL, publish, &other), 0);
    assert_int_equal(pthread_join(thread, NULL), 0);
    assert_int_equal(other.stored, STORE_OK);
    assert_int_equal(put_mesh(n, '5'), lost ? STORE_LOST : STORE_OK);
  }
  object_lock_unshare(lock);
  object_lock_close(lock);
}

typedef struct excluder {
  nodes *n;
  object_lock *lock;
  pthread_t thread;
  int has, failed; /* __atomic */
} excluder;

static void *exclude(void *argument) {
  excluder *e = argument;
  __atomic_store_n(object_lock_exclude(e->lock) ? &e->has : &e->failed, 1, __ATOMIC_RELEASE);
  return NULL;
}

/* A transaction that may have looked while the lock was held: it goes on until somebody waits for its end. */
static int wait_within(database *db, void *argument) {
  excluder *e = argument;
  (void)db;
  if (pthread_create(&e->thread, NULL, exclude, e) != 0) {
    return SQL_ERROR;
  }
  while (!ask_of_lock(e->n,
                      "SELECT count(*) FROM pg_locks WHERE locktype='advisory' AND classid=?1::oid AND NOT granted",
                      SQL_LOCK_WRITES)) {
    if (__atomic_load_n(&e->has, __ATOMIC_ACQUIRE) || __atomic_load_n(&e->failed, __ATOMIC_ACQUIRE)) {
      return SQL_CONSTRAINT;
    }
  }
  return SQL_OK;
}

static void test_excluding_waits_for_transactions(void **state) {
  nodes *n = *state;
  excluder e = {.n = n, .lock = object_lock_open(n->url)};
  assert_non_null(e.lock);
  assert_int_equal(catalogue_write(n->cat[0], wait_within, &e), STORE_OK);
  assert_int_equal(pthread_join(e.thread, NULL), 0);
  assert_true(e.has);
  object_lock_let_go(e.lock);
  object_lock_close(e.lock);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(test_order, setup, teardown),
      cmocka_unit_test_setup_teardown(test_time_counts, setup, teardown),
      cmocka_unit_test_setup_teardown(test_start_level, setup, teardown),
      cmocka_unit_test_setup_teardown(test_small_behind_large, setup, teardown),
      cmocka_unit_test_setup_teardown(test_one_flight, setup, teardown),
      cmocka_unit_test_setup_teardown(test_limits, setup, teardown),
      cmocka_unit_test_setup_teardown(test_lease, setup, teardown),
      cmocka_unit_test_setup_teardown(test_crashes, setup, teardown),
      cmocka_unit_test_setup_teardown(test_own_last_life, setup, teardown),
      cmocka_unit_test_setup_teardown(test_needs, setup, teardown),
      cmocka_unit_test_setup_teardown(test_begin, setup, teardown),
      cmocka_unit_test_setup_teardown(test_cancel, setup, teardown),
      cmocka_unit_test_setup_teardown(test_notices, setup, teardown),
      cmocka_unit_test_setup_teardown(test_publishing, setup, teardown),
      cmocka_unit_test_setup_teardown(test_announced_deletion, setup, teardown),
      cmocka_unit_test_setup_teardown(test_publishing_together, setup, teardown),
      cmocka_unit_test_setup_teardown(test_excluding_waits_for_transactions, setup, teardown),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
