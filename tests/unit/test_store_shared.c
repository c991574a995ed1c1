/* The jobs of several nodes in PostgreSQL: claims in the order of fairness, leases, fencing, one flight per key, and
 * what jobs wait for. Two catalogues on one schema stand for two nodes. Runs under tests/tools/with_postgresql.sh. */
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

#include "store/owners.h"
#include "store/shared.h"
#include "store/transactions.h"
#include "support_store_nodes.h"

enum { LEASE_MS = 300 };

/* Submits a job whose key has this digit. */
static submit_outcome submit(nodes *n, int node, const char *owner, char key, int priority, job_row *row) {
  *row = (job_row){.kind = API_JOB_EMBEDDING, .listed = 1, .cost = 12, .priority = priority, .created = 1};
  row->request = (char *)(uintptr_t) "{}";
  nodes_fill(row->key, key);
  api_random_id(row->id);
  snprintf(row->owner, sizeof row->owner, "%s", owner);
  job_submission s = {.row = row, .limit = 100};
  assert_int_equal(catalogue_job_submit(n->cat[node], &s), STORE_OK);
  return s.outcome;
}

static store_result claim_costing(nodes *n, int node, int64_t most, job_claim *out) {
  const claim_wish wish = {
      .node = node_names[node], .most_cost = most, .big = 1, .alone = 1, .alone_ms = 60000, .fetches_most = 4};
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

/* A job that fails leaves no result that anyone could own. */
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
  const int order[] = {3, 1, 2,
                       0}; /* the class first, and ann's most urgent; then bob, who had nothing yet; then ann again */
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

/* Ends a job that its worker has had for this long. */
static void end_after(nodes *n, int node, const job_claim *c, int64_t ms) {
  assert_int_equal(catalogue_write(n->cat[node], began_earlier, &ms), STORE_OK);
  end(n, node, c);
}

/* Claims a job, which must be of this owner. */
static void claim_of(nodes *n, int node, const char *owner, job_claim *c) {
  assert_int_equal(claim(n, node, c), STORE_OK);
  assert_string_equal(c->row.owner, owner);
}

/* Turns depend on the time that jobs took, not on the estimate: both owners' jobs have the same cost. */
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

/* An owner that comes after a job of another has run for an hour is not an hour ahead. */
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
  claim_of(n, 1, "bob", &c); /* bob began level with ann, when she had used an hour */
  end_after(n, 1, &c, 2 * MINUTE);
  claim_of(n, 1, "ann", &c);
}

/* A worker that is reserved for small jobs finds one behind any number of large jobs. */
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
  nodes_fill(row.key, '2');
  job_submission s = {.row = &row, .limit = 1};
  assert_int_equal(catalogue_job_submit(n->cat[1], &s), STORE_OK);
  assert_int_equal(s.outcome, SUBMIT_FULL);
  s = (job_submission){.row = &row, .limit = 9, .owner_limit = 1};
  assert_int_equal(catalogue_job_submit(n->cat[1], &s), STORE_OK);
  assert_int_equal(s.outcome, SUBMIT_QUOTA);
  /* 40 + 12 * 40 each, and two bytes of request */
  s = (job_submission){.row = &row, .limit = 9, .room = &room, .head = 40, .triangle = 40, .needs = 522};
  assert_int_equal(catalogue_job_submit(n->cat[1], &s), STORE_OK);
  assert_int_equal(s.outcome, SUBMIT_ROOM);
  assert_int_equal(room, 478);
  room = 1044;
  api_random_id(row.id);
  assert_int_equal(catalogue_job_submit(n->cat[1], &s), STORE_OK);
  assert_int_equal(s.outcome, SUBMIT_FRESH);
}

/* A suspect waits for a node that runs nothing else only for so long, and then runs beside others. */
static void expect_suspect_for_a_time(nodes *n) {
  claim_wish wish = {.node = node_names[1], .most_cost = INT64_MAX, .big = 1, .alone_ms = 60000, .fetches_most = 4};
  job_claim c;
  assert_int_equal(catalogue_claim_next(n->cat[1], &wish, &c), STORE_NOT_FOUND);
  wish.alone_ms = 0;
  assert_int_equal(catalogue_claim_next(n->cat[1], &wish, &c), STORE_OK);
  assert_int_equal(c.row.suspect, 1);
  assert_int_equal(c.row.alone, 0);
  assert_int_equal(catalogue_job_release(n->cat[1], c.row.id, c.row.attempt), STORE_OK);
  job_row_free(&c.row);
}

/* If a node is silent beyond its lease, another node runs its jobs; the first one can then neither end nor release
 * them. */
static void test_lease(void **state) {
  nodes *n = *state;
  job_row row, got;
  job_claim lost, taken;
  submit(n, 0, "ann", '1', 0, &row);
  assert_int_equal(claim(n, 0, &lost), STORE_OK);
  assert_false(catalogue_lost_jobs(n->cat[1], LEASE_MS)); /* its lease is a minute */
  assert_true(notices_renew(n->bell[0], node_names[0], 1, LEASE_MS));
  while (!catalogue_lost_jobs(n->cat[1], LEASE_MS)) {
    usleep(20000);
  }
  catalogue_recover_lost(n->cat[1], 3, 1, 7, "{}");
  assert_int_equal(catalogue_job_cancel(n->cat[1], "none"), STORE_OK); /* waits for that write */
  expect_suspect_for_a_time(n);
  assert_int_equal(claim(n, 1, &taken), STORE_OK);
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

/* The third node that falls silent while the job runs alone ends it. Earlier attempts than counted_from do not count.
 */
static void lose_nodes(nodes *n, int counted_from, int deaths) {
  job_row row, got;
  job_claim c;
  submit(n, 0, "ann", '1', 0, &row);
  for (int death = 0; death < deaths; death++) {
    assert_int_equal(claim(n, 0, &c), STORE_OK);
    assert_int_equal(c.row.alone, death > 0);
    assert_int_equal(c.row.attempt, death + 1);
    assert_true(notices_renew(n->bell[0], node_names[0], 1, 0));
    while (!catalogue_lost_jobs(n->cat[1], LEASE_MS)) {
      usleep(20000);
    }
    catalogue_recover_lost(n->cat[1], 3, counted_from, 7, "{\"crashed\":1}");
    assert_int_equal(catalogue_job_cancel(n->cat[1], "none"), STORE_OK); /* waits for that write */
    assert_true(notices_renew(n->bell[0], node_names[0], 1, 60000));
  }
  assert_int_equal(catalogue_job_get(n->cat[0], row.id, &got), STORE_OK);
  assert_int_equal(got.state, API_JOB_FAILED);
  assert_string_equal(got.problem, "{\"crashed\":1}");
  job_row_free(&got);
  assert_int_equal(claim(n, 0, &c), STORE_NOT_FOUND);
}

static void test_crashes(void **state) {
  lose_nodes(*state, 1, 4);
}

static void test_losses_that_do_not_count(void **state) {
  lose_nodes(*state, 5, 7);
}

static void test_own_last_life(void **state) {
  nodes *n = *state;
  job_row row;
  job_claim c;
  submit(n, 0, "ann", '1', 0, &row);
  submit(n, 0, "ann", '2', 0, &row);
  assert_int_equal(claim(n, 0, &c), STORE_OK);
  assert_int_equal(claim(n, 1, &c), STORE_OK);
  assert_int_equal(catalogue_recover_own(n->cat[0], node_names[0]), STORE_OK);
  assert_int_equal(claim(n, 1, &c), STORE_OK);
  assert_int_equal(c.row.suspect, 0);
  assert_int_equal(claim(n, 1, &c), STORE_NOT_FOUND); /* the other node's jobs stay */
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
  nodes_fill(keys[0], '2');
  const job_needs needs = {.row = row, .keys = keys, .requests = requests, .costs = costs, .count = 1};
  return catalogue_job_wait(n->cat[0], &needs);
}

/* Claims a job whose key has this digit. */
static void claim_key(nodes *n, int node, char digit, job_claim *out) {
  char key[API_ID_SIZE];
  nodes_fill(key, digit);
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

/* A supermesh is claimed to find out what it lacks: callers see that it runs once it has begun, or once the job for
 * what it lacks runs. */
static void test_begin(void **state) {
  nodes *n = *state;
  job_row row = {.kind = API_JOB_SUPERMESH, .listed = 1, .cost = 12, .created = 1, .owner = "ann"};
  job_claim whole;
  job_mark mark;
  row.request = (char *)(uintptr_t) "{}";
  nodes_fill(row.key, '1');
  api_random_id(row.id);
  job_submission s = {.row = &row, .limit = 100};
  assert_int_equal(catalogue_job_submit(n->cat[0], &s), STORE_OK);
  claim_key(n, 0, '1', &whole);
  assert_false(is_waiting(n, row.id, &mark));
  assert_int_equal(mark.state, API_JOB_QUEUED);
  assert_int_equal(whole.row.started, 0);
  catalogue_job_begin(n->cat[0], row.id, whole.row.attempt + 1);        /* another claim's */
  assert_int_equal(catalogue_job_list_it(n->cat[0], row.id), STORE_OK); /* writes keep their order */
  assert_false(is_waiting(n, row.id, &mark));
  assert_int_equal(mark.state, API_JOB_QUEUED);
  catalogue_job_begin(n->cat[0], row.id, whole.row.attempt);
  assert_int_equal(catalogue_job_list_it(n->cat[0], row.id), STORE_OK);
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

/* Nodes hear of a job that can be claimed, once of events that are written together, and of its end. The first event
 * tells that a job was claimed. */
static void test_notices(void **state) {
  nodes *n = *state;
  job_row row;
  job_claim c;
  char queued[2] = {'q', 0}, changed[2] = {'j', 0}, happened[2] = {'e', 0};
  submit(n, 0, "ann", '1', 0, &row);
  for (int i = 0; i < 100 && !queued[1]; i++) {
    notices_wait(n->bell[1], 100, note, queued);
  }
  assert_int_equal(queued[1], 1);
  assert_int_equal(claim(n, 0, &c), STORE_OK);
  char json[] = "{\"stage\":\"a \\\"quoted\\\" one\"}";
  for (int number = 1; number <= 3; number++) {
    catalogue_event(n->cat[0], row.id, number, "progress", json);
  }
  for (int i = 0; i < 100 && !happened[1]; i++) {
    notices_wait(n->bell[1], 100, note, happened);
  }
  assert_int_equal(happened[1], 1);
  event_row events[4];
  assert_int_equal(catalogue_events(n->cat[1], row.id, 0, 4, events), 3);
  for (int i = 0; i < 3; i++) {
    assert_int_equal(events[i].number, i + 1);
    assert_string_equal(events[i].json, json);
    free(events[i].json);
  }
  end(n, 0, &c);
  for (int i = 0; i < 100 && !changed[1]; i++) {
    notices_wait(n->bell[1], 100, note, changed);
  }
  assert_int_equal(changed[1], 1);
  assert_true(notices_does_housekeeping(n->bell[0]));
  assert_false(notices_does_housekeeping(n->bell[1]));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(test_order, nodes_setup, nodes_teardown),
      cmocka_unit_test_setup_teardown(test_time_counts, nodes_setup, nodes_teardown),
      cmocka_unit_test_setup_teardown(test_start_level, nodes_setup, nodes_teardown),
      cmocka_unit_test_setup_teardown(test_small_behind_large, nodes_setup, nodes_teardown),
      cmocka_unit_test_setup_teardown(test_one_flight, nodes_setup, nodes_teardown),
      cmocka_unit_test_setup_teardown(test_limits, nodes_setup, nodes_teardown),
      cmocka_unit_test_setup_teardown(test_lease, nodes_setup, nodes_teardown),
      cmocka_unit_test_setup_teardown(test_crashes, nodes_setup, nodes_teardown),
      cmocka_unit_test_setup_teardown(test_losses_that_do_not_count, nodes_setup, nodes_teardown),
      cmocka_unit_test_setup_teardown(test_own_last_life, nodes_setup, nodes_teardown),
      cmocka_unit_test_setup_teardown(test_needs, nodes_setup, nodes_teardown),
      cmocka_unit_test_setup_teardown(test_begin, nodes_setup, nodes_teardown),
      cmocka_unit_test_setup_teardown(test_cancel, nodes_setup, nodes_teardown),
      cmocka_unit_test_setup_teardown(test_notices, nodes_setup, nodes_teardown),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
