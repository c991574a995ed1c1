/* The store alone, in its own folder: objects, rows, owners, job attempts, events. The contracts in server/store state
 * the expected behaviour. */
#include <fcntl.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "store/catalogue.h"
#include "store/crashes.h"
#include "store/object_removal.h"
#include "store/owners.h"
#include "store/tokens.h"
#include "store/transactions.h"
#include "store/usage.h"
#include "support_store.h"

static void reopen(stored *s) {
  catalogue_close(s->cat);
  objects_close(s->store);
  assert_int_equal(objects_open(s->data, &s->store), STORE_OK);
  assert_int_equal(stored_open(s), STORE_OK);
}

static void make_id(char id[API_ID_SIZE], char digit) {
  memset(id, digit, API_ID_SIZE - 1);
  id[API_ID_SIZE - 1] = 0;
}

static int files_in(const stored *s, const char *folder) {
  char command[160];
  int count = -1;
  snprintf(command, sizeof command, "find %s/%s -type f | wc -l", s->data, folder);
  FILE *out = popen(command, "r");
  if (!out || fscanf(out, "%d", &count) != 1) {
    count = -1;
  }
  pclose(out);
  return count;
}

static void test_objects(void **state) {
  stored *s = *state;
  char id[API_ID_SIZE], other[API_ID_SIZE], part[8] = {0};
  unsigned char *bytes = NULL;
  size_t size = 0;
  uint64_t length = 0;
  int fd = -1;
  make_id(id, 'a');
  make_id(other, 'b');
  assert_int_equal(objects_read(s->store, OBJECT_MESH, id, &fd, &length), STORE_NOT_FOUND);
  assert_int_equal(objects_put(s->store, OBJECT_MESH, id, "0123456789", 10), STORE_OK);
  assert_int_equal(objects_put(s->store, OBJECT_MESH, id, "0123456789", 10), STORE_OK); /* equal ids, equal bytes */
  assert_int_equal(objects_read(s->store, OBJECT_SPHERE, id, &fd, &length),
                   STORE_NOT_FOUND); /* each kind has its own ids */
  assert_int_equal(objects_read(s->store, OBJECT_MESH, id, &fd, &length), STORE_OK);
  assert_int_equal(length, 10);
  assert_int_equal(pread(fd, part, 4, 3), 4); /* a range of it */
  assert_string_equal(part, "3456");
  assert_int_equal(objects_delete(s->store, OBJECT_MESH, id), STORE_OK);
  assert_int_equal(pread(fd, part, 4, 6), 4); /* a reader that has it open can continue */
  assert_string_equal(part, "6789");
  close(fd);
  assert_int_equal(objects_delete(s->store, OBJECT_MESH, id), STORE_OK); /* a deleted object is gone */
  assert_int_equal(objects_load(s->store, OBJECT_MESH, id, &bytes, &size), STORE_NOT_FOUND);
  assert_int_equal(objects_put(s->store, OBJECT_MESH, other, "", 0), STORE_OK);
  assert_int_equal(objects_load(s->store, OBJECT_MESH, other, &bytes, &size), STORE_OK);
  assert_int_equal(size, 0);
  free(bytes);
}

static void test_temporaries(void **state) {
  stored *s = *state;
  object_temp temp, abandoned;
  char id[API_ID_SIZE];
  unsigned char *bytes = NULL;
  size_t size = 0;
  make_id(id, 'c');
  assert_int_equal(objects_begin(s->store, &temp), STORE_OK);
  assert_int_equal(objects_begin(s->store, &abandoned), STORE_OK);
  assert_int_equal(objects_append(&temp, "whole ", 6), STORE_OK);
  assert_int_equal(objects_load(s->store, OBJECT_ASSET, id, &bytes, &size),
                   STORE_NOT_FOUND); /* nothing before the end */
  assert_int_equal(objects_append(&temp, "object", 6), STORE_OK);
  assert_int_equal(files_in(s, "tmp"), 2);
  assert_int_equal(objects_publish(s->store, &temp, OBJECT_ASSET, id), STORE_OK);
  assert_int_equal(temp.fd, -1);
  objects_abandon(&temp); /* does nothing now */
  assert_int_equal(files_in(s, "tmp"), 1);
  reopen(s); /* as after a crash: unfinished objects are swept, published ones stay */
  assert_int_equal(files_in(s, "tmp"), 0);
  close(abandoned.fd);
  assert_int_equal(objects_load(s->store, OBJECT_ASSET, id, &bytes, &size), STORE_OK);
  assert_int_equal(size, 12);
  assert_memory_equal(bytes, "whole object", 12);
  free(bytes);
}

static void test_resources(void **state) {
  stored *s = *state;
  resource row = {.kind = RESOURCE_EMBEDDING, .json = (char *)(uintptr_t) "{\"n\":1}", .bytes = 5, .created = 1000};
  resource got = {0}, page[3];
  int fresh;
  make_id(row.id, 'd');
  make_id(row.sha, 'e');
  assert_int_equal(catalogue_put_for(s->cat, &row, "", 0, &fresh), STORE_OK);
  row.json = (char *)(uintptr_t) "{\"n\":2}";
  assert_int_equal(catalogue_put_for(s->cat, &row, "", 0, &fresh), STORE_OK); /* put-if-absent keeps the first */
  assert_int_equal(catalogue_get(s->cat, RESOURCE_EMBEDDING, row.id, &got), STORE_OK);
  assert_string_equal(got.json, "{\"n\":1}");
  assert_int_equal(got.created, 1000);
  resource_free(&got);
  assert_int_equal(catalogue_get(s->cat, RESOURCE_SUPERMESH, row.id, &got), STORE_NOT_FOUND);
  for (char digit = '1'; digit <= '4'; digit++) {
    make_id(row.id, digit);
    assert_int_equal(catalogue_put_for(s->cat, &row, "", 0, &fresh), STORE_OK);
  }
  assert_int_equal(catalogue_bytes(s->cat, 1), 25);
  assert_int_equal(catalogue_list(s->cat, RESOURCE_EMBEDDING, 0, 3, page), 3); /* newest first, page by page */
  assert_int_equal(page[0].id[0], '4');
  int64_t before = page[2].seq;
  for (int i = 0; i < 3; i++) {
    resource_free(&page[i]);
  }
  assert_int_equal(catalogue_list(s->cat, RESOURCE_EMBEDDING, before, 3, page), 2);
  assert_int_equal(page[0].id[0], '1');
  assert_int_equal(page[1].id[0], 'd');
  resource_free(&page[0]);
  resource_free(&page[1]);
  assert_int_equal(catalogue_delete(s->cat, RESOURCE_EMBEDDING, row.id), STORE_OK);
  assert_int_equal(catalogue_delete(s->cat, RESOURCE_EMBEDDING, row.id), STORE_NOT_FOUND);
  assert_int_equal(catalogue_bytes(s->cat, 1), 20);
}

static job_row new_job(char digit) {
  job_row row = {
      .kind = API_JOB_EMBEDDING, .listed = 1, .cost = 100, .request = (char *)(uintptr_t) "{}", .created = 1};
  memset(row.id, digit, sizeof row.id - 1);
  make_id(row.key, digit);
  return row;
}

static job_row read_job(stored *s, const char *id) {
  job_row row;
  assert_int_equal(catalogue_job_get(s->cat, id, &row), STORE_OK);
  job_row_free(&row);
  return row;
}

/* Each step checks (job, attempt): if two workers both claim a job, one is refused. */
static void test_attempts(void **state) {
  stored *s = *state;
  job_row job = new_job('1');
  resource result = {.kind = RESOURCE_EMBEDDING, .json = (char *)(uintptr_t) "{}", .bytes = 1, .created = 1}, got = {0};
  event_row events[4];
  memcpy(result.id, job.key, sizeof result.id);
  make_id(result.sha, 'f');
  assert_int_equal(catalogue_job_insert(s->cat, &job, NULL), STORE_OK);
  assert_int_equal(catalogue_job_insert(s->cat, &job, NULL), STORE_CONFLICT); /* ids are unique */
  assert_int_equal(catalogue_job_claim(s->cat, job.id, 2, 0, 10), STORE_CONFLICT);
  assert_int_equal(catalogue_job_claim(s->cat, job.id, 1, 0, 10), STORE_OK);
  assert_int_equal(catalogue_job_claim(s->cat, job.id, 1, 0, 11), STORE_CONFLICT);
  assert_int_equal(catalogue_job_release(s->cat, job.id, 2), STORE_CONFLICT);
  assert_int_equal(catalogue_job_release(s->cat, job.id, 1), STORE_OK); /* does not count */
  assert_int_equal(read_job(s, job.id).attempt, 0);
  assert_int_equal(catalogue_job_claim(s->cat, job.id, 1, 0, 20), STORE_OK);
  assert_int_equal(read_job(s, job.id).started, 10);
  assert_int_equal(catalogue_job_claim(s->cat, job.id, 2, 0, 30), STORE_OK); /* taken over */
  assert_int_equal(
      catalogue_job_finish(
          s->cat, job.id, 1,
          &(job_end){.state = API_JOB_SUCCEEDED, .result = &result, .now = 40, .event = 5, .event_json = "{}"}),
      STORE_CONFLICT);
  assert_int_equal(catalogue_get(s->cat, RESOURCE_EMBEDDING, result.id, &got), STORE_NOT_FOUND); /* nor its result */
  assert_int_equal(catalogue_events(s->cat, job.id, 0, 4, events), 0);
  assert_int_equal(
      catalogue_job_finish(
          s->cat, job.id, 2,
          &(job_end){.state = API_JOB_SUCCEEDED, .result = &result, .now = 50, .event = 6, .event_json = "{}"}),
      STORE_OK);
  assert_int_equal(catalogue_job_finish(
                       s->cat, job.id, 2,
                       &(job_end){.state = API_JOB_FAILED, .problem = "{}", .now = 60, .event = 7, .event_json = "{}"}),
                   STORE_CONFLICT);
  assert_int_equal(catalogue_job_claim(s->cat, job.id, 3, 0, 70), STORE_CONFLICT);
  assert_int_equal(read_job(s, job.id).state, API_JOB_SUCCEEDED);
  assert_int_equal(catalogue_get(s->cat, RESOURCE_EMBEDDING, result.id, &got), STORE_OK);
  resource_free(&got);
  assert_int_equal(catalogue_events(s->cat, job.id, 0, 4, events), 1);
  assert_int_equal(events[0].number, 6);
  assert_string_equal(events[0].type, "succeeded");
  free(events[0].json);
}

static int64_t crashes_of(stored *s, const char *tenant) {
  usage_row row = {0};
  assert_int_equal(catalogue_usage(s->cat, tenant, tenant, 0, 1, &row), 1);
  return row.crashes;
}

/* Notes a crash, and waits for the write behind it. */
static void crash(stored *s, const char *key, const char *tenant, int64_t now) {
  catalogue_crash_of_mesh(s->cat, key, tenant, now);
  assert_int_equal(catalogue_crash_clear(s->cat, "none"), STORE_NOT_FOUND);
}

/* The deaths of one key count for the tenant of each, and together they refuse the key. */
static void test_crashes_of_tenants(void **state) {
  stored *s = *state;
  char key[API_ID_SIZE];
  api_text list = {0};
  make_id(key, 'c');
  crash(s, key, "ann", 1);
  crash(s, key, "bob", 2);
  assert_int_equal(catalogue_crashed(s->cat, key), 0);
  crash(s, key, "ann", 3);
  assert_int_equal(catalogue_crashed(s->cat, key), 1);
  assert_int_equal(crashes_of(s, "ann"), 2);
  assert_int_equal(crashes_of(s, "bob"), 1);
  assert_int_equal(crashes_of(s, "eve"), 0);
  assert_int_equal(catalogue_crash_list(s->cat, &list), 2);
  assert_non_null(strstr(list.data, "crashes=2 refused"));
  assert_non_null(strstr(list.data, "crashes=1 refused"));
  api_text_free(&list);
  assert_int_equal(catalogue_crash_clear(s->cat, "ann"), STORE_OK);
  assert_int_equal(catalogue_crashed(s->cat, key), 0);
  assert_int_equal(crashes_of(s, "ann"), 0);
  assert_int_equal(crashes_of(s, "bob"), 1);
  assert_int_equal(catalogue_crash_clear(s->cat, "ccc"), STORE_OK);
  assert_int_equal(crashes_of(s, "bob"), 0);
}

/* The death of a supermesh's process is listed with all its meshes, and any of them clears it. */
static void test_crashes_of_supermeshes(void **state) {
  stored *s = *state;
  job_row job = new_job('a');
  assert_int_equal(catalogue_job_insert(s->cat, &job, NULL), STORE_OK);
  job.request = (char *)(uintptr_t) "{\"shapes\":[{\"mesh\":\"dab1\"},{\"mesh\":\"cab2\"},{\"mesh\":\"dab1\"}]}";
  static const char *const names[] = {"dab", "cab2"};
  for (int i = 0; i < 2; i++) {
    api_text list = {0};
    assert_int_equal(catalogue_job_claim(s->cat, job.id, 1 + i, 1, 10), STORE_OK);
    job.attempt = 1 + i;
    assert_int_equal(catalogue_job_crashed(s->cat, &job, 1, 0, 20), STORE_OK);
    assert_int_equal(catalogue_crash_list(s->cat, &list), 1);
    assert_true(strstr(list.data, " mesh=dab1,cab2 ") || strstr(list.data, " mesh=cab2,dab1 "));
    api_text_free(&list);
    assert_int_equal(catalogue_crash_clear(s->cat, "ab"), STORE_NOT_FOUND); /* no mesh begins so */
    assert_int_equal(catalogue_crash_clear(s->cat, names[i]), STORE_OK);
  }
}

/* After a crash, the jobs that ran are queued again as suspects. A job that ran alone in three crashes fails, with a
 * last event. */
static void test_recovery(void **state) {
  stored *s = *state;
  job_row a = new_job('a'), b = new_job('b'), waiting = new_job('c'), rows[4];
  event_row events[4];
  assert_int_equal(catalogue_job_insert(s->cat, &a, NULL), STORE_OK);
  assert_int_equal(catalogue_job_insert(s->cat, &b, NULL), STORE_OK);
  assert_int_equal(catalogue_job_insert(s->cat, &waiting, NULL), STORE_OK);
  assert_int_equal(catalogue_job_claim(s->cat, a.id, 1, 0, 10), STORE_OK);
  assert_int_equal(catalogue_job_claim(s->cat, b.id, 1, 0, 10), STORE_OK);
  catalogue_event(s->cat, a.id, 3, "progress", "{}");
  reopen(s);
  assert_int_equal(catalogue_recover(s->cat, 3, 20, "{\"why\":1}"), STORE_OK);
  assert_int_equal(read_job(s, a.id).state, API_JOB_QUEUED);
  assert_int_equal(read_job(s, a.id).suspect, 1);
  assert_int_equal(read_job(s, a.id).crashes, 0); /* it was not alone */
  assert_int_equal(read_job(s, waiting.id).suspect, 0);
  for (int death = 1; death <= 3; death++) {
    assert_int_equal(catalogue_job_claim(s->cat, a.id, 1 + death, 1, 30), STORE_OK);
    reopen(s);
    assert_int_equal(catalogue_recover(s->cat, 3, 40, "{\"why\":1}"), STORE_OK);
    assert_int_equal(read_job(s, a.id).crashes, death);
    assert_int_equal(read_job(s, a.id).state, death < 3 ? API_JOB_QUEUED : API_JOB_FAILED);
  }
  assert_int_equal(catalogue_job_claim(s->cat, a.id, 5, 1, 50), STORE_CONFLICT);
  assert_int_equal(catalogue_events(s->cat, a.id, 3, 4, events), 1);
  assert_string_equal(events[0].type, "failed");
  assert_non_null(strstr(events[0].json, "\"why\":1"));
  free(events[0].json);
  assert_int_equal(catalogue_unfinished(s->cat, 0, 4, rows), 2); /* b and the one that waited, oldest first */
  assert_memory_equal(rows[0].id, b.id, sizeof b.id);
  assert_memory_equal(rows[1].id, waiting.id, sizeof b.id);
  job_row_free(&rows[0]);
  job_row_free(&rows[1]);
}

/* Owners come and go; the resource goes with its last owner, and its bytes count for each owner. */
static void test_owners(void **state) {
  stored *s = *state;
  resource row = {.kind = RESOURCE_MESH, .json = (char *)(uintptr_t) "{\"of\":\"ann\"}", .bytes = 60, .created = 1000};
  resource got = {0};
  int fresh = 0, gone = 0;
  make_id(row.id, 'a');
  make_id(row.sha, 'b');
  assert_int_equal(catalogue_put_for(s->cat, &row, "ann", 100, &fresh), STORE_OK);
  assert_true(fresh);
  assert_int_equal(catalogue_put_for(s->cat, &row, "ann", 100, &fresh), STORE_OK);
  assert_false(fresh);
  assert_int_equal(catalogue_tenant_bytes(s->cat, "ann"), 60); /* once */
  row.json = (char *)(uintptr_t) "{\"of\":\"bob\"}";
  row.created = 2000;
  assert_int_equal(catalogue_put_for(s->cat, &row, "bob", 59, &fresh), STORE_CONFLICT);
  assert_int_equal(catalogue_get_of(s->cat, RESOURCE_MESH, row.id, "bob", &got), STORE_NOT_FOUND);
  assert_int_equal(catalogue_put_for(s->cat, &row, "bob", 60, &fresh), STORE_OK);
  assert_true(fresh);
  assert_int_equal(catalogue_get_of(s->cat, RESOURCE_MESH, row.id, "bob", &got), STORE_OK);
  assert_string_equal(got.json, "{\"of\":\"bob\"}");
  assert_int_equal(got.created, 2000);
  resource_free(&got);
  assert_int_equal(catalogue_get_of(s->cat, RESOURCE_MESH, row.id, "ann", &got), STORE_OK);
  assert_string_equal(got.json, "{\"of\":\"ann\"}");
  resource_free(&got);
  assert_int_equal(catalogue_bytes(s->cat, 0), 60); /* stored once */

  assert_int_equal(catalogue_disown(s->cat, RESOURCE_MESH, row.id, "eve", &gone), STORE_NOT_FOUND);
  assert_int_equal(catalogue_disown(s->cat, RESOURCE_MESH, row.id, "ann", &gone), STORE_OK);
  assert_false(gone);
  assert_int_equal(catalogue_tenant_bytes(s->cat, "ann"), 0);
  assert_int_equal(catalogue_get_of(s->cat, RESOURCE_MESH, row.id, "ann", &got), STORE_NOT_FOUND);
  assert_int_equal(catalogue_disown(s->cat, RESOURCE_MESH, row.id, "bob", &gone), STORE_OK);
  assert_true(gone);
  assert_int_equal(catalogue_get(s->cat, RESOURCE_MESH, row.id, &got), STORE_NOT_FOUND);

  /* If the operator deletes it, it is gone for everyone, and so are its bytes. */
  assert_int_equal(catalogue_put_for(s->cat, &row, "ann", 0, &fresh), STORE_OK);
  assert_int_equal(catalogue_put_for(s->cat, &row, "bob", 0, &fresh), STORE_OK);
  assert_int_equal(catalogue_delete(s->cat, RESOURCE_MESH, row.id), STORE_OK);
  assert_int_equal(catalogue_tenant_bytes(s->cat, "ann"), 0);
  assert_int_equal(catalogue_tenant_bytes(s->cat, "bob"), 0);
  assert_int_equal(catalogue_mismatches(s->cat), 0);
}

/* Every tenant that requested a result owns it: the first with its original description, others with the time of their
 * own job. A job whose result is deleted before the job ends does not succeed. */
static void test_owners_of_results(void **state) {
  stored *s = *state;
  job_row ann = new_job('1'), bob = new_job('2'), eve = new_job('3');
  resource result = {.kind = RESOURCE_EMBEDDING,
                     .json = (char *)(uintptr_t) "{\"w\":1.50,\"created\":\"1970-01-01T00:00:00.050Z\"}",
                     .bytes = 1,
                     .created = 50};
  resource got = {0};
  memcpy(bob.key, ann.key, sizeof bob.key);
  memcpy(eve.key, ann.key, sizeof eve.key);
  memcpy(result.id, ann.key, sizeof result.id);
  make_id(result.sha, 'f');
  strcpy(ann.owner, "ann");
  strcpy(bob.owner, "bob");
  strcpy(eve.owner, "eve");
  job_row *jobs[] = {&ann, &bob, &eve};
  for (int i = 0; i < 3; i++) {
    assert_int_equal(catalogue_job_insert(s->cat, jobs[i], NULL), STORE_OK);
  }
  assert_int_equal(catalogue_job_claim(s->cat, ann.id, 1, 0, 10), STORE_OK); /* one flight a key */
  assert_int_equal(
      catalogue_job_finish(
          s->cat, ann.id, 1,
          &(job_end){.state = API_JOB_SUCCEEDED, .result = &result, .now = 50, .event = 5, .event_json = "{}"}),
      STORE_OK);
  assert_int_equal(catalogue_get_of(s->cat, RESOURCE_EMBEDDING, result.id, "bob", &got), STORE_NOT_FOUND);
  assert_int_equal(catalogue_job_claim(s->cat, bob.id, 1, 0, 10), STORE_OK);
  assert_int_equal(
      catalogue_job_finish(s->cat, bob.id, 1,
                           &(job_end){.state = API_JOB_SUCCEEDED, .now = 86400123, .event = 5, .event_json = "{}"}),
      STORE_OK);
  assert_int_equal(catalogue_job_claim(s->cat, eve.id, 1, 0, 10), STORE_OK);
  assert_int_equal(catalogue_get_of(s->cat, RESOURCE_EMBEDDING, result.id, "ann", &got), STORE_OK);
  assert_string_equal(got.json, result.json);
  resource_free(&got);
  assert_int_equal(catalogue_get_of(s->cat, RESOURCE_EMBEDDING, result.id, "bob", &got), STORE_OK);
  assert_string_equal(got.json, "{\"w\":1.50,\"created\":\"1970-01-02T00:00:00.123Z\"}");
  resource_free(&got);
  assert_int_equal(catalogue_tenant_derived(s->cat, "ann"), 1);
  assert_int_equal(catalogue_tenant_derived(s->cat, "bob"), 1);
  assert_int_equal(catalogue_mismatches(s->cat), 0);
  assert_int_equal(catalogue_delete(s->cat, RESOURCE_EMBEDDING, result.id), STORE_OK);
  assert_int_equal(catalogue_tenant_derived(s->cat, "ann"), 0);
  assert_int_equal(catalogue_tenant_derived(s->cat, "bob"), 0);
  assert_int_equal(
      catalogue_job_finish(s->cat, eve.id, 1,
                           &(job_end){.state = API_JOB_SUCCEEDED, .now = 70, .event = 5, .event_json = "{}"}),
      STORE_CONFLICT);
  assert_int_equal(read_job(s, eve.id).state, API_JOB_RUNNING);
}

/* What jobs make counts for the tenants that own it: with the profiles of an asset, which come later, and kept
 * alignments, until the row is deleted or given up. */
static void test_derived_bytes(void **state) {
  stored *s = *state;
  job_row job = new_job('1');
  resource result = {.kind = RESOURCE_SUPERMESH, .json = (char *)(uintptr_t) "{}", .bytes = 100, .created = 50};
  resource kept = {.kind = RESOURCE_ALIGNMENT, .json = (char *)(uintptr_t) "{}", .bytes = 30, .created = 50};
  char ids[2][API_ID_SIZE];
  int gone;
  job.kind = API_JOB_SUPERMESH;
  strcpy(job.owner, "ann");
  memcpy(result.id, job.key, sizeof result.id);
  make_id(result.sha, 'f');
  make_id(kept.id, 'c');
  make_id(kept.sha, 'd');
  assert_int_equal(catalogue_job_insert(s->cat, &job, NULL), STORE_OK);
  assert_int_equal(catalogue_job_claim(s->cat, job.id, 1, 0, 10), STORE_OK);
  const job_end end = {.state = API_JOB_SUCCEEDED,
                       .result = &result,
                       .now = 50,
                       .event = 5,
                       .event_json = "{}",
                       .owner = "ann",
                       .worker_ms = 70};
  assert_int_equal(catalogue_job_finish(s->cat, job.id, 1, &end), STORE_OK);
  assert_int_equal(catalogue_tenant_derived(s->cat, "ann"), 100);
  assert_int_equal(catalogue_add_profile(s->cat, result.id, 0, "a", 11), STORE_OK);
  assert_int_equal(catalogue_add_profile(s->cat, result.id, 0, "b", 11), STORE_OK); /* made again: counted once */
  assert_int_equal(catalogue_tenant_derived(s->cat, "ann"), 111);
  assert_int_equal(catalogue_put_alignment(s->cat, &kept, "ann"), STORE_OK);
  assert_int_equal(catalogue_tenant_derived(s->cat, "ann"), 141);
  assert_int_equal(catalogue_put_alignment(s->cat, &kept, "bob"), STORE_OK); /* made again, for another tenant */
  assert_int_equal(catalogue_tenant_derived(s->cat, "ann"), 111);
  assert_int_equal(catalogue_tenant_derived(s->cat, "bob"), 30);
  assert_int_equal(catalogue_alignments_of(s->cat, "ann", 2, ids), 0);
  assert_int_equal(catalogue_alignments_of(s->cat, "bob", 2, ids), 1);
  assert_string_equal(ids[0], kept.id);
  assert_int_equal(catalogue_delete(s->cat, RESOURCE_ALIGNMENT, kept.id), STORE_OK);
  assert_int_equal(catalogue_tenant_derived(s->cat, "bob"), 0);
  assert_int_equal(catalogue_tenant_bytes(s->cat, "ann"), 0); /* the quota of meshes is another one */
  assert_int_equal(catalogue_mismatches(s->cat), 0);

  usage_row used[4];
  assert_int_equal(catalogue_usage(s->cat, "ann", "ann", 0, 4, used), 1);
  assert_int_equal(used[0].derived, 111);
  assert_int_equal(used[0].worker_ms, 70);
  catalogue_add_time(s->cat, "eve", 5);
  assert_int_equal(catalogue_disown(s->cat, RESOURCE_SUPERMESH, result.id, "ann", &gone), STORE_OK);
  assert_int_equal(catalogue_usage(s->cat, "", NULL, 0, 4, used), 4);
  assert_string_equal(used[1].tenant, "ann"); /* after "" */
  assert_int_equal(used[1].derived, 0);
  assert_int_equal(used[1].worker_ms, 70);
  assert_string_equal(used[3].tenant, "eve");
  assert_int_equal(used[3].worker_ms, 5);
  assert_int_equal(catalogue_usage(s->cat, "", NULL, 3, 4, used), 1);
}

static int64_t derived_of(stored *s, const char *tenant) {
  usage_row used;
  assert_int_equal(catalogue_usage(s->cat, tenant, tenant, 0, 1, &used), 1);
  return used.derived;
}

/* The request of a job counts for its owner until the job ends; then the row gives it back. */
static void test_requests_count(void **state) {
  stored *s = *state;
  static const char request[] = "{\"landmarks\":\"twenty-nine bytes\"}";
  job_row jobs[3] = {new_job('1'), new_job('2'), new_job('3')};
  for (int i = 0; i < 3; i++) {
    jobs[i].request = (char *)(uintptr_t)request;
    strcpy(jobs[i].owner, i < 2 ? "ann" : "bob");
    assert_int_equal(catalogue_job_insert(s->cat, &jobs[i], NULL), STORE_OK);
  }
  const int64_t one = (int64_t)strlen(request);
  assert_int_equal(derived_of(s, "ann"), 2 * one);
  assert_int_equal(derived_of(s, "bob"), one);
  assert_int_equal(catalogue_tenant_derived(s->cat, "ann"), 0); /* the queue adds the requests of unfinished jobs */
  assert_int_equal(catalogue_job_claim(s->cat, jobs[0].id, 1, 0, 10), STORE_OK);
  reopen(s);
  char *text = catalogue_job_request(s->cat, jobs[0].id);
  assert_string_equal(text, request);
  free(text);
  const job_end end = {.state = API_JOB_FAILED, .problem = "{}", .now = 50, .owner = "ann"};
  assert_int_equal(catalogue_job_finish(s->cat, jobs[0].id, 1, &end), STORE_OK);
  assert_int_equal(derived_of(s, "ann"), one);
  text = catalogue_job_request(s->cat, jobs[0].id);
  assert_string_equal(text, "{}");
  free(text);
  assert_int_equal(catalogue_jobs_forget(s->cat, 3), STORE_OK);
  assert_int_equal(derived_of(s, "ann"), one);
  assert_int_equal(derived_of(s, "bob"), one);
  assert_int_equal(catalogue_damaged(s->cat), 0);
  assert_int_equal(catalogue_mismatches(s->cat), 0);
}

/* A tenant that requests a job owns the meshes that the job names, so their first owner can give them up. A missing
 * mesh refuses the job if a client waits for the answer. */
static void test_owners_of_meshes(void **state) {
  stored *s = *state;
  resource mesh = {.kind = RESOURCE_MESH,
                   .json = (char *)(uintptr_t) "{\"name\":\"secret\",\"created\":\"\"}",
                   .bytes = 60,
                   .created = 1000};
  resource got = {0};
  int fresh, gone;
  make_id(mesh.id, 'a');
  make_id(mesh.sha, 'b');
  assert_int_equal(catalogue_put_for(s->cat, &mesh, "ann", 0, &fresh), STORE_OK);
  char request[256];
  snprintf(request, sizeof request, "{\"shapes\":[{\"mesh\":\"%s\"},{\"mesh\":\"%s\"}]}", mesh.id, mesh.id);
  job_row job = new_job('1'), second = new_job('2');
  job.request = second.request = request;
  job.listed = second.listed = 1;
  job.created = 86400123;
  strcpy(job.owner, "root");
  assert_int_equal(catalogue_job_insert(s->cat, &job, NULL), STORE_OK);
  assert_int_equal(catalogue_get_of(s->cat, RESOURCE_MESH, mesh.id, "root", &got), STORE_OK);
  assert_string_equal(got.json, "{\"name\":\"\",\"created\":\"1970-01-02T00:00:00.123Z\"}");
  resource_free(&got);
  assert_int_equal(catalogue_tenant_bytes(s->cat, "root"), 60);
  assert_int_equal(catalogue_disown(s->cat, RESOURCE_MESH, mesh.id, "ann", &gone), STORE_OK);
  assert_false(gone);
  assert_int_equal(catalogue_disown(s->cat, RESOURCE_MESH, mesh.id, "root", &gone), STORE_OK);
  assert_true(gone);
  assert_int_equal(catalogue_job_insert(s->cat, &second, NULL), STORE_NOT_FOUND);
  job_row absent;
  assert_int_equal(catalogue_job_get(s->cat, second.id, &absent), STORE_NOT_FOUND);
  assert_int_equal(catalogue_mismatches(s->cat), 0);
}

/* The oldest finished jobs are deleted with their events, unfinished jobs never. */
static void test_forgetting(void **state) {
  stored *s = *state;
  job_row jobs[4] = {new_job('1'), new_job('2'), new_job('3'), new_job('4')}, got;
  event_row event;
  for (int i = 0; i < 4; i++) { /* the oldest has not ended */
    assert_int_equal(catalogue_job_insert(s->cat, &jobs[i], NULL), STORE_OK);
    assert_int_equal(catalogue_job_claim(s->cat, jobs[i].id, 1, 0, 10), STORE_OK);
    catalogue_event(s->cat, jobs[i].id, 1, "progress", "{}");
    if (i > 0) {
      assert_int_equal(
          catalogue_job_finish(
              s->cat, jobs[i].id, 1,
              &(job_end){.state = API_JOB_FAILED, .problem = "{}", .now = 50, .event = 5, .event_json = "{}"}),
          STORE_OK);
    }
  }
  assert_int_equal(catalogue_jobs_ended(s->cat), 3);
  assert_int_equal(catalogue_jobs_forget(s->cat, 2), STORE_OK);
  assert_int_equal(catalogue_jobs_ended(s->cat), 1);
  for (int i = 0; i < 4; i++) {
    int stays = i == 0 || i == 3;
    assert_int_equal(catalogue_job_get(s->cat, jobs[i].id, &got), stays ? STORE_OK : STORE_NOT_FOUND);
    assert_int_equal(catalogue_events(s->cat, jobs[i].id, 0, 1, &event), stays);
    if (stays) {
      job_row_free(&got);
      free(event.json);
    }
  }
  assert_int_equal(catalogue_jobs_forget(s->cat, 100), STORE_OK);
  assert_int_equal(read_job(s, jobs[0].id).state, API_JOB_RUNNING);
}

/* The store takes any number of tokens and lists all by name. */
typedef struct number {
  char *all; /* the numbers of the writes in the order in which they ran */
  char own;
} number;

static int note_number(database *db, void *arg) {
  const number *n = arg;
  (void)db;
  __atomic_store_n(n->all + strlen(n->all), n->own, __ATOMIC_RELEASE);
  return SQL_OK;
}

static void *number_of(char *all, char own) {
  number *n = malloc(sizeof *n);
  assert_non_null(n);
  *n = (number){all, own};
  return n;
}

/* Delayed writes run in order: with the next write that a caller waits for, or soon without one. */
static void test_gathered(void **state) {
  stored *s = *state;
  char all[64] = "";
  for (int i = 0; i < 5; i++) {
    catalogue_write_gathered(s->cat, note_number, number_of(all, (char)('a' + i)));
  }
  number last = {all, 'z'};
  assert_int_equal(catalogue_write(s->cat, note_number, &last), STORE_OK);
  assert_string_equal(all, "abcdez");
  char alone[64] = "";
  catalogue_write_gathered(s->cat, note_number, number_of(alone, 'a'));
  for (int i = 0; i < 1000 && !__atomic_load_n(alone, __ATOMIC_ACQUIRE); i++) {
    usleep(5000);
  }
  assert_string_equal(alone, "a");
  catalogue_write_gathered(s->cat, note_number, number_of(alone, 'b'));
  catalogue_close(s->cat); /* completes all */
  assert_string_equal(alone, "ab");
  assert_int_equal(stored_open(s), STORE_OK);
}

static void test_many_tokens(void **state) {
  stored *s = *state;
  enum { MANY = 1100 };
  int count;
  for (int i = 0; i < MANY; i++) {
    token_row row = {.scopes = 1};
    snprintf(row.name, sizeof row.name, "t%05d", MANY - i);
    memcpy(row.hash, &i, sizeof i);
    assert_int_equal(catalogue_token_add(s->cat, &row), STORE_OK);
  }
  token_row *rows = catalogue_tokens(s->cat, &count);
  assert_int_equal(count, MANY);
  assert_string_equal(rows[0].name, "t00001");
  assert_string_equal(rows[MANY - 1].name, "t01100");
  free(rows);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(test_objects, stored_setup, stored_teardown),
      cmocka_unit_test_setup_teardown(test_temporaries, stored_setup, stored_teardown),
      cmocka_unit_test_setup_teardown(test_resources, stored_setup, stored_teardown),
      cmocka_unit_test_setup_teardown(test_attempts, stored_setup, stored_teardown),
      cmocka_unit_test_setup_teardown(test_crashes_of_tenants, stored_setup, stored_teardown),
      cmocka_unit_test_setup_teardown(test_crashes_of_supermeshes, stored_setup, stored_teardown),
      cmocka_unit_test_setup_teardown(test_recovery, stored_setup, stored_teardown),
      cmocka_unit_test_setup_teardown(test_owners, stored_setup, stored_teardown),
      cmocka_unit_test_setup_teardown(test_derived_bytes, stored_setup, stored_teardown),
      cmocka_unit_test_setup_teardown(test_requests_count, stored_setup, stored_teardown),
      cmocka_unit_test_setup_teardown(test_owners_of_results, stored_setup, stored_teardown),
      cmocka_unit_test_setup_teardown(test_owners_of_meshes, stored_setup, stored_teardown),
      cmocka_unit_test_setup_teardown(test_forgetting, stored_setup, stored_teardown),
      cmocka_unit_test_setup_teardown(test_gathered, stored_setup, stored_teardown),
      cmocka_unit_test_setup_teardown(test_many_tokens, stored_setup, stored_teardown),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
