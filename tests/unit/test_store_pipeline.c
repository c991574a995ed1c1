/* Statements of PostgreSQL whose results come later: errors, broken expectations and lost connections leave nothing
 * half written. Runs under tests/tools/with_postgresql.sh. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "store/postgresql_connection.h"
#include "store/transactions.h"
#include "support_store_nodes.h"

static const char insert[] = "INSERT INTO crash(key, mesh, tenant, count, last) VALUES(?1, '', '', ?2, 0)";

static int add(database *db, int64_t key) {
  char text[24];
  snprintf(text, sizeof text, "%lld", (long long)key);
  sql_statement *st = database_statement(db, insert);
  assert_non_null(st);
  sql_bind_text(st, 1, text); /* sent, or copied, before this function returns */
  sql_bind_integer(st, 2, key);
  return database_run_later(db, st, SQL_ANY);
}

static int64_t rows(nodes *n) {
  database *db = catalogue_reader(n->cat[1]);
  sql_statement *st = database_statement(db, "SELECT count(*) FROM crash");
  assert_non_null(st);
  assert_int_equal(sql_step(st), SQL_ROW);
  int64_t count = sql_integer(st, 0);
  sql_reset(st);
  catalogue_reader_done(n->cat[1], db);
  return count;
}

static int write_many(database *db, void *argument) {
  int code = SQL_OK;
  for (int64_t i = 0; i < 2 * PGSQL_SENT + 3 && code == SQL_OK; i++) {
    code = add(db, *(const int64_t *)argument + i);
  }
  return code;
}

static int write_one(database *db, void *argument) {
  return add(db, *(const int64_t *)argument);
}

static int break_rule(database *db, void *argument) {
  const int64_t key = *(const int64_t *)argument;
  return add(db, key) == SQL_OK ? add(db, key) : SQL_ERROR; /* the key is there already */
}

static int change_none(database *db, void *argument) {
  int code = database_run_later(db, database_statement(db, "UPDATE crash SET last=1 WHERE key='none'"), SQL_ONE_CHANGE);
  return code == SQL_OK ? add(db, *(const int64_t *)argument) : code;
}

static int expect_zero(database *db, void *argument) {
  int code = database_run_later(db, database_statement(db, "SELECT 7"), SQL_ZERO);
  return code == SQL_OK ? add(db, *(const int64_t *)argument) : code;
}

/* A statement with a result ends the wait for those before it. */
static int read_after(database *db, void *argument) {
  int64_t *key = argument;
  int code = add(db, *key);
  sql_statement *st = database_statement(db, "SELECT count(*) FROM crash WHERE key=?1::bigint::text");
  assert_non_null(st);
  sql_bind_integer(st, 1, *key);
  code = code == SQL_OK ? sql_step(st) : code;
  *key = code == SQL_ROW ? sql_integer(st, 0) : -1;
  sql_reset(st);
  return code == SQL_ROW ? SQL_OK : code;
}

static void test_many(void **state) {
  nodes *n = *state;
  int64_t first = 1000;
  assert_int_equal(catalogue_write(n->cat[0], write_many, &first), STORE_OK);
  assert_int_equal(rows(n), 2 * PGSQL_SENT + 3);
}

static void test_failures(void **state) {
  nodes *n = *state;
  static const struct {
    write_fn write;
    store_result result;
  } bad[] = {{break_rule, STORE_CONFLICT}, {change_none, STORE_CONFLICT}, {expect_zero, STORE_LOST}};
  int64_t key = 1;
  for (int i = 0; i < 3; i++) {
    /* Alone, it is the first to use its statements. */
    assert_int_equal(catalogue_write(n->cat[0], bad[i].write, &key), bad[i].result);
    assert_int_equal(rows(n), i);
    /* Written together with it, others are written. */
    int64_t *waiting = malloc(sizeof *waiting), other = 100 + i;
    assert_non_null(waiting);
    *waiting = key;
    catalogue_write_gathered(n->cat[0], bad[i].write, waiting);
    assert_int_equal(catalogue_write(n->cat[0], write_one, &other), STORE_OK);
    assert_int_equal(rows(n), i + 1);
  }
}

static void test_read(void **state) {
  nodes *n = *state;
  int64_t key = 5;
  assert_int_equal(catalogue_write(n->cat[0], read_after, &key), STORE_OK);
  assert_int_equal(key, 1);
}

typedef struct cut {
  nodes *n;
  int runs, most; /* it cuts its own connection in so many runs */
  int64_t key;
} cut;

static int cut_while_writing(database *db, void *argument) {
  cut *c = argument;
  int code = add(db, c->key);
  if (code == SQL_OK && c->runs++ < c->most) {
    code = database_run_later(db, database_statement(db, "SELECT pg_terminate_backend(pg_backend_pid())"), SQL_ANY);
  }
  return code == SQL_OK ? add(db, c->key + 1) : code;
}

/* Before its commit is sent, a transaction has done nothing, so it runs again, once. */
static void test_lost(void **state) {
  nodes *n = *state;
  cut c = {.n = n, .most = 1, .key = 1};
  assert_int_equal(catalogue_write(n->cat[0], cut_while_writing, &c), STORE_OK);
  assert_int_equal(c.runs, 2);
  assert_int_equal(rows(n), 2);
  c = (cut){.n = n, .most = 2, .key = 11};
  assert_int_equal(catalogue_write(n->cat[0], cut_while_writing, &c), STORE_ERROR);
  assert_int_equal(rows(n), 2);
  int64_t key = 21;
  assert_int_equal(catalogue_write(n->cat[0], write_one, &key), STORE_OK);
  assert_int_equal(rows(n), 3);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(test_many, nodes_setup, nodes_teardown),
      cmocka_unit_test_setup_teardown(test_failures, nodes_setup, nodes_teardown),
      cmocka_unit_test_setup_teardown(test_read, nodes_setup, nodes_teardown),
      cmocka_unit_test_setup_teardown(test_lost, nodes_setup, nodes_teardown),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
