/* Eviction over more rows than one page: rows that unfinished jobs need stay, wherever they are in the order of use;
 * the others leave, oldest first, and no more than the budget requires. Also tests what leaves together with a damaged
 * object. */
#include <pthread.h>
#include <semaphore.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "evict.h"
#include "log.h"
#include "store/object_removal.h"
#include "store/owners.h"

enum { NEEDED = 150, FREE = 150, ROW_BYTES = 10 };

typedef struct stored {
  char data[64];
  evict_env env;
} stored;

static int setup(void **state) {
  stored *s = calloc(1, sizeof *s);
  const queue_options options = {.workers = 1, .cores = 1, .limit = 1000};
  strcpy(s->data, access("/dev/shm", W_OK) == 0 ? "/dev/shm/orbmorph-evict-XXXXXX" : "/tmp/orbmorph-evict-XXXXXX");
  if (!mkdtemp(s->data) || objects_open(s->data, &s->env.store) != STORE_OK ||
      catalogue_open(s->data, &s->env.cat) != STORE_OK || !(s->env.q = queue_create(&options, s->env.cat))) {
    return -1;
  }
  *state = s;
  return 0;
}

static int teardown(void **state) {
  stored *s = *state;
  char command[128];
  queue_stop(s->env.q, 1);
  queue_destroy(s->env.q);
  catalogue_close(s->env.cat);
  objects_close(s->env.store);
  snprintf(command, sizeof command, "rm -rf %s", s->data);
  int failed = system(command);
  free(s);
  return failed;
}

static void number_id(char id[API_ID_SIZE], char kind, int number) {
  memset(id, kind, API_ID_SIZE - 1);
  id[API_ID_SIZE - 1] = 0;
  for (int at = API_ID_SIZE - 2; number > 0 || at == API_ID_SIZE - 2; at--, number /= 10) {
    id[at] = (char)('0' + number % 10);
  }
}

/* An embedding of mesh `number`, last used at `used`. */
static void add_embedding(stored *s, int number, int64_t used) {
  char json[160], mesh[API_ID_SIZE];
  resource row = {.kind = RESOURCE_EMBEDDING, .json = json, .bytes = ROW_BYTES, .created = used};
  number_id(row.id, 'e', number);
  number_id(row.sha, 'f', number);
  number_id(mesh, 'a', number);
  snprintf(json, sizeof json, "{\"mesh\":\"%s\"}", mesh);
  int fresh;
  assert_int_equal(catalogue_put_for(s->env.cat, &row, "", 0, &fresh), STORE_OK);
}

static void need_mesh(stored *s, int number) {
  char key[API_ID_SIZE], mesh[API_ID_SIZE], text[160];
  job *j = NULL;
  number_id(key, 'c', number);
  number_id(mesh, 'a', number);
  snprintf(text, sizeof text, "{\"mesh\":\"%s\"}", mesh);
  const queue_request request = {.kind = API_JOB_EMBEDDING, .key = key, .request = text, .owner = "", .cost = 1};
  assert_int_equal(queue_submit(s->env.q, &request, &j, NULL), QUEUE_OK);
  queue_release(s->env.q, j);
}

static int is_there(stored *s, int number) {
  resource got = {0};
  char id[API_ID_SIZE];
  number_id(id, 'e', number);
  store_result result = catalogue_get(s->env.cat, RESOURCE_EMBEDDING, id, &got);
  resource_free(&got);
  assert_true(result == STORE_OK || result == STORE_NOT_FOUND);
  return result == STORE_OK;
}

/* Jobs need the 150 oldest: more than two pages come before the first row that may leave. */
static void test_needed_rows_fill_pages(void **state) {
  stored *s = *state;
  for (int i = 0; i < NEEDED; i++) {
    add_embedding(s, i, 1000 + i);
    need_mesh(s, i);
  }
  for (int i = 0; i < FREE; i++) {
    add_embedding(s, NEEDED + i, 2000 + i);
  }
  const int64_t all = (NEEDED + FREE) * ROW_BYTES;
  assert_int_equal(evict_derived(&s->env, all, INT64_MAX), all); /* within the budget nothing leaves */
  assert_int_equal(evict_derived(&s->env, all - 25, INT64_MAX), all - 30);
  for (int i = 0; i < NEEDED + FREE; i++) {
    assert_int_equal(is_there(s, i), i < NEEDED || i >= NEEDED + 3);
  }
  assert_int_equal(evict_derived(&s->env, 0, 2000 + FREE - 5),
                   (NEEDED + 5) * ROW_BYTES); /* rows used since then stay */
  assert_int_equal(evict_derived(&s->env, 0, INT64_MAX), NEEDED * ROW_BYTES);
  for (int i = 0; i < NEEDED + FREE; i++) {
    assert_int_equal(is_there(s, i), i < NEEDED);
  }
  evict_env without = s->env;
  without.q = NULL; /* without jobs nothing is needed */
  assert_int_equal(evict_derived(&without, 5 * ROW_BYTES, INT64_MAX), 5 * ROW_BYTES);
  for (int i = 0; i < NEEDED; i++) {
    assert_int_equal(is_there(s, i), i >= NEEDED - 5);
  }
}

/* A profile becomes part of its supermesh: its bytes count, and its object leaves with the row. */
static void test_profiles_belong_to_the_supermesh(void **state) {
  stored *s = *state;
  char json[] = "{}", sha[API_ID_SIZE], lost[API_ID_SIZE];
  int fresh;
  unsigned char *bytes = NULL;
  size_t size;
  resource row = {.kind = RESOURCE_SUPERMESH, .json = json, .bytes = ROW_BYTES, .created = 1}, got = {0};
  number_id(row.id, 'e', 1);
  number_id(row.sha, 'f', 1);
  number_id(sha, 'd', 1);
  number_id(lost, 'c', 1);
  assert_int_equal(catalogue_put_for(s->env.cat, &row, "", 0, &fresh), STORE_OK);
  for (int p = 0; p < PROFILES_STORED; p++) {
    assert_int_equal(objects_put(s->env.store, object_of_profile(p), row.id, "0123456", 7), STORE_OK);
    assert_int_equal(catalogue_add_profile(s->env.cat, row.id, p, sha, 7), STORE_OK);
    assert_int_equal(catalogue_add_profile(s->env.cat, row.id, p, sha, 7), STORE_OK); /* again: counted once */
  }
  assert_int_equal(catalogue_bytes(s->env.cat, 1), ROW_BYTES + 14);
  assert_int_equal(catalogue_mismatches(s->env.cat), 0);
  assert_int_equal(catalogue_get(s->env.cat, RESOURCE_SUPERMESH, row.id, &got), STORE_OK);
  assert_string_equal(got.profiles[0], sha);
  assert_string_equal(got.profiles[1], sha);
  assert_int_equal(got.bytes, ROW_BYTES + 14);
  resource_free(&got);
  assert_int_equal(catalogue_add_profile(s->env.cat, lost, 0, sha, 7), STORE_NOT_FOUND);
  assert_int_equal(evict_derived(&s->env, ROW_BYTES, INT64_MAX), 0);
  for (int p = 0; p < PROFILES_STORED; p++) {
    assert_int_equal(objects_load(s->env.store, object_of_profile(p), row.id, &bytes, &size), STORE_NOT_FOUND);
  }
}

/* Deletes the row of a damaged embedding, once the test says so. */
typedef struct healer {
  stored *s;
  sem_t begun, may;
  atomic_int healed;
} healer;

static void heal(void *user, object_kind kind, const char *id) {
  healer *h = user;
  sem_post(&h->begun);
  sem_wait(&h->may);
  evict_damaged(&h->s->env, kind, id);
  atomic_store(&h->healed, 1);
}

static void *quarantine_main(void *user) {
  healer *h = user;
  int fd;
  uint64_t size;
  char id[API_ID_SIZE];
  number_id(id, 'e', 1);
  assert_int_equal(objects_read(h->s->env.store, OBJECT_SPHERE, id, &fd, &size), STORE_OK);
  assert_int_equal(objects_quarantine(h->s->env.store, OBJECT_SPHERE, id, fd), STORE_NOT_FOUND);
  close(fd);
  return NULL;
}

static void *release_main(void *user) {
  sem_post(&((healer *)user)->may);
  return NULL;
}

/* Between the move to quarantine and the end of the row, the row names an object that does not exist. A caller that
 * finds this and waits no longer sees the row. */
static void test_a_damaged_result_is_gone_after_settling(void **state) {
  stored *s = *state;
  healer h = {.s = s};
  pthread_t mover, releaser;
  int fd;
  uint64_t size;
  char id[API_ID_SIZE];
  number_id(id, 'e', 1);
  sem_init(&h.begun, 0, 0);
  sem_init(&h.may, 0, 0);
  objects_settle(s->env.store); /* nothing to wait for */
  add_embedding(s, 1, 1000);
  assert_int_equal(objects_put(s->env.store, OBJECT_SPHERE, id, "wrong", 5), STORE_OK);
  objects_on_quarantine(s->env.store, heal, &h);
  assert_int_equal(pthread_create(&mover, NULL, quarantine_main, &h), 0);
  sem_wait(&h.begun);
  assert_int_equal(objects_read(s->env.store, OBJECT_SPHERE, id, &fd, &size), STORE_NOT_FOUND);
  assert_true(is_there(s, 1));
  assert_int_equal(pthread_create(&releaser, NULL, release_main, &h), 0);
  objects_settle(s->env.store);
  assert_int_equal(atomic_load(&h.healed), 1);
  assert_false(is_there(s, 1));
  pthread_join(mover, NULL);
  pthread_join(releaser, NULL);
  sem_destroy(&h.begun);
  sem_destroy(&h.may);
}

int main(void) {
  log_setup(LOG_WARN, 0); /* each evicted object is logged */
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(test_needed_rows_fill_pages, setup, teardown),
      cmocka_unit_test_setup_teardown(test_profiles_belong_to_the_supermesh, setup, teardown),
      cmocka_unit_test_setup_teardown(test_a_damaged_result_is_gone_after_settling, setup, teardown),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
