/* Webhooks below HTTP: the signature of Standard Webhooks, the waits between attempts, and the outbox. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "deliver/deliver.h"
#include "deliver/sign.h"
#include "store/deliveries.h"
#include "support_store.h"

/* The vector of the reference libraries, https://github.com/standard-webhooks/standard-webhooks. */
static void signatures(void **state) {
  static const char body[] = "{\"test\": 2432232314}", id[] = "msg_p5jXN8AQM9LWM0D4loKWxJek";
  char out[WEBHOOK_SIGNATURE], secret[WEBHOOK_SECRET], other[WEBHOOK_SECRET];
  (void)state;
  assert_int_equal(webhook_sign("whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw", id, 1614265330, body, sizeof body - 1, out),
                   1);
  assert_string_equal(out, "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE=");
  assert_int_equal(webhook_sign("MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw", id, 1, body, 1, out), 0);
  assert_int_equal(webhook_sign("whsec_no base64", id, 1, body, 1, out), 0);
  webhook_new_secret(secret);
  webhook_new_secret(other);
  assert_int_equal(strlen(secret), 6 + 44); /* 32 bytes */
  assert_string_not_equal(secret, other);
  assert_int_equal(webhook_sign(secret, id, 1, body, 1, out), 1);
}

static void waits(void **state) {
  int64_t sum = 0;
  int attempts = 1;
  (void)state;
  for (int64_t wait; (wait = deliver_wait_ms(5000, attempts, 0.5)) >= 0; attempts++) {
    assert_int_equal(wait, 5000 << (attempts - 1));
    sum += wait;
  }
  assert_int_equal(attempts, 15);
  assert_true(sum > 22 * 3600000LL && sum < 24 * 3600000LL); /* a day */
  assert_int_equal(deliver_wait_ms(1000, 1, 0), 950);
  assert_int_equal(deliver_wait_ms(1000, 1, 1), 1050);
}

static job_row job_of(const char *id, const char *owner, const char *key) {
  job_row job = {.listed = 1, .request = "{}", .created = 1};
  snprintf(job.id, sizeof job.id, "%s", id);
  snprintf(job.owner, sizeof job.owner, "%s", owner);
  snprintf(job.key, sizeof job.key, "%s", key);
  return job;
}

static void end(stored *s, job_row *job, const job_webhook *hook, api_job_state how) {
  assert_int_equal(catalogue_job_insert(s->cat, job, hook), STORE_OK);
  assert_int_equal(catalogue_job_finish(s->cat, job->id, 0,
                                        &(job_end){.state = how, .now = 1000, .event = 5, .event_json = "{\"a\":1}"}),
                   STORE_OK);
}

static void add(stored *s, const char *name, const char *tenant, const char *origin, unsigned events) {
  webhook_row row = {.events = events, .created = 1};
  snprintf(row.name, sizeof row.name, "%s", name);
  snprintf(row.tenant, sizeof row.tenant, "%s", tenant);
  snprintf(row.url, sizeof row.url, "%s/", origin);
  snprintf(row.origin, sizeof row.origin, "%s", origin);
  webhook_new_secret(row.secret);
  assert_int_equal(catalogue_webhook_add(s->cat, &row), STORE_OK);
  assert_int_equal(catalogue_webhook_add(s->cat, &row), STORE_CONFLICT);
}

#define ALL 100
static int due(stored *s, int64_t now, int share, delivery_row *rows) {
  int count = catalogue_deliveries_due(s->cat, now, share, ALL, rows);
  for (int i = 0; i < count; i++) {
    delivery_row_free(&rows[i]);
  }
  return count;
}

static void outbox(void **state) {
  stored *s = *state;
  delivery_row *rows = calloc(ALL, sizeof *rows);
  job_webhook hook = {
      .url = "https://a.example/x", .origin = "https://a.example:443", .events = API_EVENT(API_JOB_FAILED)};
  job_row first = job_of("11111111111111111111111111111111", "ann", "k1");
  job_row second = job_of("22222222222222222222222222222222", "ann", "k2");
  job_row hidden = job_of("33333333333333333333333333333333", "ann", "k3");
  job_row others = job_of("44444444444444444444444444444444", "bob", "k4");
  add(s, "site", "ann", "https://b.example:443", API_EVENTS_ALL);
  add(s, "wins", "ann", "https://b.example:443", API_EVENT(API_JOB_SUCCEEDED));
  assert_int_equal(catalogue_deliveries_next(s->cat), INT64_MAX);
  end(s, &first, &hook, API_JOB_FAILED);
  assert_int_equal(catalogue_deliveries_of(s->cat, first.id, ALL, rows), 2);
  assert_int_equal(rows[0].number, 1);
  assert_string_equal(rows[0].webhook, "@ann");
  assert_string_equal(rows[0].url, "https://a.example/x");
  assert_string_equal(rows[0].type, "job.failed");
  assert_string_equal(rows[1].webhook, "site");
  end(s, &second, NULL, API_JOB_CANCELLED);
  hidden.listed = 0; /* no caller knows this job */
  end(s, &hidden, NULL, API_JOB_FAILED);
  end(s, &others, NULL, API_JOB_FAILED);
  assert_int_equal(catalogue_deliveries_pending(s->cat), 3);

  /* One message at a time for each receiver: the second receiver's two messages go one after the other. */
  assert_int_equal(catalogue_deliveries_next(s->cat), 1000);
  assert_int_equal(due(s, 999, ALL, rows), 0);
  assert_int_equal(due(s, 1000, 1, rows), 1);
  assert_int_equal(due(s, 1000, ALL, rows), 2);
  assert_int_equal(strlen(rows[0].secret), 6 + 44);
  int site = strcmp(rows[0].webhook, "site") == 0 ? 0 : 1;
  assert_string_equal(rows[site].job, first.id);
  rows[site].state = API_DELIVERY_PENDING;
  rows[site].next = 9000;
  rows[1 - site].state = API_DELIVERY_DELIVERED;
  rows[1 - site].status = 204;
  assert_int_equal(catalogue_deliveries_record(s->cat, rows, 2, 2000), STORE_OK);
  assert_int_equal(due(s, 3000, ALL, rows), 1);
  assert_string_equal(rows[0].job, second.id); /* not delayed by the one that failed */
  assert_int_equal(catalogue_deliveries_of(s->cat, first.id, ALL, rows), 2);
  assert_int_equal(rows[0].state, API_DELIVERY_DELIVERED);
  assert_int_equal(rows[0].status, 204);
  assert_int_equal(rows[0].ended, 2000);
  assert_int_equal(rows[1].attempts, 1);
  assert_int_equal(rows[1].next, 9000);

  /* A retry by hand. A message that waits for another attempt keeps its time. */
  assert_int_equal(catalogue_delivery_retry(s->cat, first.id, 3, 4000), STORE_NOT_FOUND);
  assert_int_equal(catalogue_delivery_retry(s->cat, first.id, 1, 4000), STORE_OK);
  assert_int_equal(due(s, 4000, ALL, rows), 2);
  assert_int_equal(catalogue_webhook_remove(s->cat, "site"), STORE_OK);
  assert_int_equal(catalogue_webhook_remove(s->cat, "site"), STORE_NOT_FOUND);
  assert_int_equal(catalogue_deliveries_pending(s->cat), 1);
  assert_int_equal(due(s, INT64_MAX, ALL, rows), 1);
  assert_int_equal(catalogue_deliveries_next(s->cat), 4000);

  /* A job that is deleted keeps its pending messages. */
  assert_int_equal(catalogue_jobs_forget(s->cat, 4), STORE_OK);
  assert_int_equal(catalogue_deliveries_of(s->cat, first.id, ALL, rows), 1);
  rows[0].state = API_DELIVERY_DELIVERED;
  assert_int_equal(catalogue_deliveries_record(s->cat, rows, 1, 5000), STORE_OK);
  assert_int_equal(catalogue_deliveries_of(s->cat, first.id, ALL, rows), 0);
  assert_int_equal(catalogue_deliveries_next(s->cat), INT64_MAX);
  free(rows);
}

/* Requests that share a job add their webhooks, JOB_WEBHOOKS at most, even if the job has just ended. */
static void shared(void **state) {
  stored *s = *state;
  delivery_row *rows = calloc(ALL, sizeof *rows);
  char url[64];
  job_webhook hook = {.url = url, .origin = "https://a.example:443", .events = API_EVENTS_ALL};
  job_row job = job_of("11111111111111111111111111111111", "", "k");
  assert_int_equal(catalogue_job_insert(s->cat, &job, NULL), STORE_OK);
  for (int i = 0; i < JOB_WEBHOOKS; i++) {
    snprintf(url, sizeof url, "https://a.example/%d", i);
    assert_int_equal(catalogue_job_subscribe(s->cat, job.id, &hook), STORE_OK);
    assert_int_equal(catalogue_job_subscribe(s->cat, job.id, &hook), STORE_OK); /* once */
  }
  snprintf(url, sizeof url, "https://a.example/more");
  assert_int_equal(catalogue_job_subscribe(s->cat, job.id, &hook), STORE_CONFLICT);
  assert_int_equal(catalogue_deliveries_of(s->cat, job.id, ALL, rows), 0);
  assert_int_equal(
      catalogue_job_finish(s->cat, job.id, 0,
                           &(job_end){.state = API_JOB_CANCELLED, .now = 1000, .event = 5, .event_json = "{\"a\":1}"}),
      STORE_OK);
  assert_int_equal(catalogue_deliveries_of(s->cat, job.id, ALL, rows), JOB_WEBHOOKS);
  assert_int_equal(catalogue_job_subscribe(s->cat, job.id, &hook), STORE_OK);
  assert_int_equal(catalogue_deliveries_of(s->cat, job.id, ALL, rows), JOB_WEBHOOKS + 1);
  assert_int_equal(rows[JOB_WEBHOOKS].number, JOB_WEBHOOKS + 1);
  assert_string_equal(rows[JOB_WEBHOOKS].url, url);
  assert_string_equal(rows[JOB_WEBHOOKS].type, "job.cancelled");
  free(rows);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(signatures),
      cmocka_unit_test(waits),
      cmocka_unit_test_setup_teardown(outbox, stored_setup, stored_teardown),
      cmocka_unit_test_setup_teardown(shared, stored_setup, stored_teardown),
  };
  return sodium_init() < 0 ? 1 : cmocka_run_group_tests(tests, NULL, NULL);
}
