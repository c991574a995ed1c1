/* Locks over several nodes: the lock of objects (publishing, excluding, lost connections, announced deletions) and the
 * lock of the schema. Several catalogues on one schema in PostgreSQL stand for nodes. Runs under
 * tests/tools/with_postgresql.sh. */
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

#include "store/object_lock.h"
#include "store/owners.h"
#include "store/postgresql_schema.h"
#include "store/transactions.h"
#include "support_store_nodes.h"

static store_result put_mesh(nodes *n, char digit) {
  char json[] = "{}";
  int fresh;
  resource row = {.kind = RESOURCE_MESH, .json = json, .bytes = 1, .created = 1};
  nodes_fill(row.id, digit);
  nodes_fill(row.sha, digit);
  return catalogue_put_for(n->cat[0], &row, "", 0, &fresh);
}

static int has_mesh(nodes *n, char digit) {
  char id[API_ID_SIZE];
  resource row = {0};
  nodes_fill(id, digit);
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

/* Sets how long an announcement is valid, in ms. */
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
  assert_true(object_lock_exclude(there)); /* published objects may be deleted now */
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

/* A node may lose the lock after it has announced a deletion: its request may come to S3 late. A node that publishes
 * waits for that, and a node without the lock announces nothing. */
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

/* A thread that begins to share after the lock was lost takes it for itself, not for the threads before it. */
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

/* A transaction that may have read while the lock was held: it goes on until a caller waits for its end. */
static int wait_within(database *db, void *argument) {
  excluder *e = argument;
  if (database_settle(db) != SQL_OK) { /* until then it may not have begun */
    return SQL_ERROR;
  }
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

static int schema_of(database *db) {
  int version = 0;
  assert_int_equal(db->connection.driver->version(&db->connection, &version), SQL_OK);
  return version;
}

typedef struct opener {
  const char *url;
  catalogue *cat;
  store_result result;
  pthread_t thread;
} opener;

static void *open_node(void *user) {
  opener *o = user;
  o->result = catalogue_open_shared(o->url, 1, &o->cat);
  return NULL;
}

/* While a node runs that needs the older schema, a newer node neither starts on it nor migrates it. After the older
 * node has ended, several nodes may start at once, and one of them migrates. */
static void test_older_schema(void **state) {
  char url[NODES_URL], mark[64];
  database old;
  catalogue *cat = NULL;
  (void)state;
  assert_true(nodes_new_catalogue(url));
  assert_int_equal(database_open(url, SQL_SHARES, &old), SQL_OK);
  for (int i = 0; i < postgresql_schema - 1; i++) {
    assert_int_equal(database_execute(&old, postgresql_migrations[i]), SQL_OK);
  }
  snprintf(mark, sizeof mark, "UPDATE catalogue SET schema=%d", postgresql_schema - 1);
  assert_int_equal(database_execute(&old, mark), SQL_OK);
  assert_int_equal(old.connection.driver->hold(&old.connection), SQL_OK);

  assert_int_equal(catalogue_open_shared(url, 1, &cat), STORE_UNFIT);
  assert_null(cat);
  assert_int_equal(schema_of(&old), postgresql_schema - 1);
  database_close(&old);

  opener openers[3] = {{.url = url}, {.url = url}, {.url = url}};
  for (int i = 0; i < 3; i++) {
    assert_int_equal(pthread_create(&openers[i].thread, NULL, open_node, &openers[i]), 0);
  }
  for (int i = 0; i < 3; i++) {
    assert_int_equal(pthread_join(openers[i].thread, NULL), 0);
    assert_int_equal(openers[i].result, STORE_OK);
  }
  database *db = catalogue_reader(openers[0].cat);
  assert_int_equal(schema_of(db), postgresql_schema);
  catalogue_reader_done(openers[0].cat, db);
  for (int i = 0; i < 3; i++) {
    catalogue_close(openers[i].cat);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(test_publishing, nodes_setup, nodes_teardown),
      cmocka_unit_test_setup_teardown(test_announced_deletion, nodes_setup, nodes_teardown),
      cmocka_unit_test_setup_teardown(test_publishing_together, nodes_setup, nodes_teardown),
      cmocka_unit_test_setup_teardown(test_excluding_waits_for_transactions, nodes_setup, nodes_teardown),
      cmocka_unit_test(test_older_schema),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
