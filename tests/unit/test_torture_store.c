/* The store while memory, files, SQLite and threads fail: everything that it reported as done exists, also after a
 * restart; it reports every failure; afterwards it works. */
#include <limits.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "log.h"
#include "store/deliveries.h"
#include "store/owners.h"
#include "store/tokens.h"
#include "support_store.h"
#include "torture/torture.h"

/* Every run has a unique number, stored.number, which names what it creates. */
static void make_id(char *out, size_t size, char kind, int64_t number) {
  snprintf(out, size, "%c%0*llx", kind, (int)size - 2, (unsigned long long)number);
}

static resource new_resource(resource_kind kind, char letter, int64_t number) {
  resource r = {.kind = kind, .json = (char *)(uintptr_t) "{\"a\":1}", .bytes = 7, .created = 5};
  make_id(r.id, sizeof r.id, letter, number);
  make_id(r.sha, sizeof r.sha, 'f', number);
  return r;
}

static job_row new_job(int64_t number) {
  job_row row = {.kind = API_JOB_EMBEDDING, .listed = 1, .cost = 12, .owner = "me", .created = 1};
  make_id(row.id, sizeof row.id, 'd', number);
  make_id(row.key, sizeof row.key, 'e', number);
  row.request = (char *)(uintptr_t) "{\"r\":1}";
  return row;
}

static const job_webhook webhook = {.url = "https://a.example/", .origin = "https://a.example:443", .events = 7};

/* What the calls of a run returned. */
typedef struct told {
  store_result object, mesh, job, claim, finish, record, token, gone;
} told;

static void check_resource(stored *s, const resource *wanted) {
  resource got = {0};
  assert_int_equal(catalogue_get_of(s->cat, wanted->kind, wanted->id, "me", &got), STORE_OK);
  assert_string_equal(got.sha, wanted->sha);
  assert_string_equal(got.json, wanted->json);
  resource_free(&got);
}

static void check(stored *s, const told *t, int64_t number) {
  resource mesh = new_resource(RESOURCE_MESH, 'a', number), result = new_resource(RESOURCE_EMBEDDING, 'e', number);
  job_row job = new_job(number), got;
  if (t->object == STORE_OK) {
    unsigned char *bytes = NULL;
    size_t size = 0;
    assert_int_equal(objects_load(s->store, OBJECT_MESH, mesh.id, &bytes, &size), STORE_OK);
    assert_true(size == 5 && memcmp(bytes, "hello", 5) == 0);
    free(bytes);
  }
  if (t->mesh == STORE_OK) {
    check_resource(s, &mesh);
  }
  if (t->job == STORE_OK) {
    assert_int_equal(catalogue_job_get(s->cat, job.id, &got), STORE_OK);
    char *request = catalogue_job_request(s->cat, job.id);
    assert_string_equal(request, got.state == API_JOB_SUCCEEDED ? "{}" : job.request);
    free(request);
    assert_true(got.state == API_JOB_SUCCEEDED || (t->finish != STORE_OK && got.state < API_JOB_SUCCEEDED));
    job_row_free(&got);
  }
  if (t->finish == STORE_OK) {
    event_row event;
    if (t->gone == STORE_OK) {
      resource none;
      assert_int_equal(catalogue_get(s->cat, result.kind, result.id, &none), STORE_NOT_FOUND);
    } else {
      check_resource(s, &result);
    }
    assert_int_equal(catalogue_events(s->cat, job.id, 3, 1, &event), 1);
    assert_int_equal(event.number, 4);
    free(event.json);
    delivery_row announced;
    assert_int_equal(catalogue_deliveries_of(s->cat, job.id, 1, &announced), 1);
    assert_int_equal(announced.number, 1);
    assert_true(t->record == STORE_OK ? announced.state == API_DELIVERY_DELIVERED : announced.attempts <= 1);
  }
}

/* A list is complete or reports an error. */
static void read_lists(stored *s, const told *t) {
  resource rows[8];
  job_row jobs[8];
  event_row events[8];
  int count;
  int n = catalogue_list_of(s->cat, RESOURCE_MESH, "me", 0, 8, rows);
  assert_true(n < 0 || t->mesh != STORE_OK || n > 0);
  for (int i = 0; i < n; i++) {
    assert_string_equal(rows[i].json, "{\"a\":1}");
    assert_int_equal(strlen(rows[i].id), API_ID_SIZE - 1);
    resource_free(&rows[i]);
  }
  n = catalogue_job_list(s->cat, "me", NULL, -1, 0, 8, jobs);
  assert_true(n < 0 || t->job != STORE_OK || n > 0);
  for (int i = 0; i < n; i++) {
    assert_int_equal(strlen(jobs[i].id), API_JOB_ID_SIZE - 1);
    job_row_free(&jobs[i]);
  }
  n = catalogue_events(s->cat, new_job(s->number).id, 0, 8, events);
  for (int i = 0; i < n; i++) {
    free(events[i].json);
  }
  token_row *tokens = catalogue_tokens(s->cat, &count);
  assert_true(count < 0 || t->token != STORE_OK || count > 0);
  for (int i = 0; i < count; i++) {
    assert_true(tokens[i].name[0] == 't');
  }
  free(tokens);
}

/* Sends all due messages, all to one receiver: STORE_OK if the job's message was among them and is recorded. */
static store_result deliver(stored *s, const char *job) {
  store_result result = STORE_NOT_FOUND;
  for (int turn = 0; turn < 8 && result == STORE_NOT_FOUND; turn++) {
    delivery_row due;
    if (catalogue_deliveries_due(s->cat, 30, 8, 1, &due) < 1) {
      return STORE_ERROR;
    }
    assert_true(due.body[0] == '{' && due.secret[0] == 'w');
    due.state = API_DELIVERY_DELIVERED;
    store_result recorded = catalogue_deliveries_record(s->cat, &due, 1, 40);
    result = recorded != STORE_OK || strcmp(due.job, job) == 0 ? recorded : STORE_NOT_FOUND;
    delivery_row_free(&due);
  }
  return result;
}

static told work(stored *s, int64_t number) {
  told t;
  int fresh, gone;
  resource mesh = new_resource(RESOURCE_MESH, 'a', number), result = new_resource(RESOURCE_EMBEDDING, 'e', number);
  job_row job = new_job(number);
  token_row token = {.scopes = 1, .created = 1};
  snprintf(token.name, sizeof token.name, "t%lld", (long long)number);
  memcpy(token.hash, &number, sizeof number);
  t.object = objects_put(s->store, OBJECT_MESH, mesh.id, "hello", 5);
  t.mesh = catalogue_put_for(s->cat, &mesh, "me", 1000000000, &fresh);
  t.job = catalogue_job_insert(s->cat, &job, &webhook);
  t.claim = catalogue_job_claim(s->cat, job.id, 1, 0, 10);
  catalogue_event(s->cat, job.id, 3, "progress", "{}");
  t.finish = catalogue_job_finish(s->cat, job.id, 1,
                                  &(job_end){.state = API_JOB_SUCCEEDED,
                                             .result = &result,
                                             .now = 20,
                                             .event = 4,
                                             .event_json = "{\"state\":\"succeeded\"}"});
  t.record = deliver(s, job.id);
  t.token = catalogue_token_add(s->cat, &token);
  read_lists(s, &t);
  t.gone = catalogue_disown(s->cat, RESOURCE_EMBEDDING, result.id, "me", &gone);
  assert_int_equal(gone, t.gone == STORE_OK);
  return t;
}

/* Removes the tokens: the store limits their number. */
static void tidy(stored *s, int64_t number) {
  char name[32];
  snprintf(name, sizeof name, "t%lld", (long long)number);
  (void)catalogue_token_remove(s->cat, name);
}

static int one_work(void *user, torture_kind kind, long number, int for_ever) {
  stored *s = user;
  s->number++;
  torture_arm(kind, number, for_ever);
  told t = work(s, s->number);
  int met = torture_disarm();
  check(s, &t, s->number);
  if (!met) {
    assert_true(t.object == STORE_OK && t.mesh == STORE_OK && t.job == STORE_OK && t.claim == STORE_OK &&
                t.finish == STORE_OK && t.record == STORE_OK && t.token == STORE_OK && t.gone == STORE_OK);
    assert_int_equal(catalogue_mismatches(s->cat), 0);
  }
  s->number++;
  told well = work(s, s->number);
  assert_true(well.object == STORE_OK && well.mesh == STORE_OK && well.finish == STORE_OK && well.record == STORE_OK &&
              well.token == STORE_OK);
  tidy(s, s->number - 1);
  tidy(s, s->number);
  return met;
}

/* Opens a store and recovers it: one job ran, one waits and one crashed alone too often. */
static int one_start(void *user, torture_kind kind, long number, int for_ever) {
  stored *s = user;
  job_row ran = new_job(++s->number), waits = new_job(++s->number), rows[8];
  assert_int_equal(catalogue_job_insert(s->cat, &ran, NULL), STORE_OK);
  assert_int_equal(catalogue_job_claim(s->cat, ran.id, 1, 1, 10), STORE_OK);
  assert_int_equal(catalogue_job_insert(s->cat, &waits, NULL), STORE_OK);
  catalogue_close(s->cat);
  s->cat = NULL;
  torture_arm(kind, number, for_ever);
  int opened = catalogue_open(s->data, &s->cat) == STORE_OK;
  int recovered = opened && catalogue_recover(s->cat, 1, 20, "{\"why\":1}") == STORE_OK;
  int unfinished = recovered ? catalogue_unfinished(s->cat, 0, 8, rows) : -1;
  int met = torture_disarm();
  for (int i = 0; i < unfinished; i++) {
    job_row_free(&rows[i]);
  }
  assert_true(unfinished == 1 || (met && unfinished < 0)); /* all, or an error */
  if (!opened) {
    s->cat = NULL;
    assert_int_equal(catalogue_open(s->data, &s->cat), STORE_OK);
  }
  assert_int_equal(catalogue_recover(s->cat, 1, 20, "{\"why\":1}"), STORE_OK);
  job_row got;
  assert_int_equal(catalogue_job_get(s->cat, ran.id, &got), STORE_OK);
  assert_int_equal(got.state, API_JOB_FAILED);
  assert_string_equal(got.problem, "{\"why\":1}");
  job_row_free(&got);
  assert_int_equal(catalogue_job_claim(s->cat, waits.id, 1, 0, 10), STORE_OK);
  assert_int_equal(
      catalogue_job_finish(s->cat, waits.id, 1,
                           &(job_end){.state = API_JOB_CANCELLED, .now = 20, .event = 4, .event_json = "{}"}),
      STORE_OK);
  return met;
}

static void all_ways(stored *s, torture_run run, torture_kind kind, int step, long least) {
  static const char *const names[] = {"allocations", "calls of SQLite", "calls of files", "starts of threads"};
  for (int for_ever = 0; for_ever < 2; for_ever++) {
    long failures = torture(run, s, kind, for_ever, 1, LONG_MAX, step);
    print_message("%ld %s failed, %s\n", failures, names[kind], for_ever ? "for ever" : "once");
    assert_true(failures >= least);
  }
}

static void test_work(void **state) {
  all_ways(*state, one_work, TORTURE_ALLOC, 1, 50);
  all_ways(*state, one_work, TORTURE_SQLITE, 1, 20);
  all_ways(*state, one_work, TORTURE_FILE, 1, 4);
}

/* SQLite allocates a lot when it opens: fails a sample of the allocations, all of them with ORB_TORTURE_ALL=1. */
static void test_start(void **state) {
  all_ways(*state, one_start, TORTURE_ALLOC, getenv("ORB_TORTURE_ALL") ? 1 : 7, 50);
  all_ways(*state, one_start, TORTURE_SQLITE, 1, 10);
  all_ways(*state, one_start, TORTURE_THREAD, 1, 1);
}

int main(void) {
  torture_begin();
  log_setup((log_level)(LOG_ERROR + 1), 0); /* silent: every failure would be logged */
  const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(test_work, stored_setup, stored_teardown),
                                     cmocka_unit_test_setup_teardown(test_start, stored_setup, stored_teardown)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
