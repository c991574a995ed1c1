/* Migrates catalogues of older versions in SQLite and checks their rows. */
#include <setjmp.h>
#include <sqlite3.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "store/catalogue.h"
#include "store/crashes.h"
#include "store/owners.h"
#include "store/tokens.h"
#include "store/usage.h"
#include "support_store.h"

static int version_of(sqlite3 *db) {
  sqlite3_stmt *st = NULL;
  int version = -1;
  if (sqlite3_prepare_v2(db, "PRAGMA user_version", -1, &st, NULL) == SQLITE_OK && sqlite3_step(st) == SQLITE_ROW) {
    version = sqlite3_column_int(st, 0);
  }
  sqlite3_finalize(st);
  return version;
}

/* The first version of the schema. */
static const char first_schema[] =
    "CREATE TABLE resource(seq INTEGER PRIMARY KEY AUTOINCREMENT, kind INTEGER NOT NULL, id TEXT NOT NULL,"
    " sha TEXT NOT NULL, json TEXT NOT NULL, bytes INTEGER NOT NULL, created INTEGER NOT NULL, used INTEGER NOT NULL,"
    " UNIQUE(kind, id));"
    "CREATE INDEX resource_used ON resource(used);"
    "CREATE TABLE job(seq INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE, key TEXT NOT NULL,"
    " kind INTEGER NOT NULL, state INTEGER NOT NULL, attempt INTEGER NOT NULL, crashes INTEGER NOT NULL DEFAULT 0,"
    " suspect INTEGER NOT NULL DEFAULT 0, alone INTEGER NOT NULL DEFAULT 0, listed INTEGER NOT NULL,"
    " priority INTEGER NOT NULL, cost INTEGER NOT NULL, owner TEXT NOT NULL, request TEXT NOT NULL, problem TEXT,"
    " created INTEGER NOT NULL, started INTEGER NOT NULL DEFAULT 0, finished INTEGER NOT NULL DEFAULT 0);"
    "CREATE INDEX job_state ON job(state, seq);"
    "CREATE TABLE event(job TEXT NOT NULL, number INTEGER NOT NULL, type TEXT NOT NULL, json TEXT NOT NULL,"
    " PRIMARY KEY(job, number)) WITHOUT ROWID;"
    "CREATE TABLE token(hash TEXT PRIMARY KEY, name TEXT NOT NULL UNIQUE, scopes INTEGER NOT NULL,"
    " quota_bytes INTEGER NOT NULL, quota_jobs INTEGER NOT NULL, created INTEGER NOT NULL);";

/* Replaces the catalogue by one of the first schema and runs the given SQL on it. Returns the newest version. */
static int replace_catalogue(stored *s, const char *more, char path[96]) {
  static const char *const suffixes[] = {"", "-wal", "-shm"};
  sqlite3 *db = NULL;
  snprintf(path, 96, "%s/catalogue.sqlite", s->data);
  assert_int_equal(sqlite3_open(path, &db), SQLITE_OK);
  int newest = version_of(db);
  sqlite3_close(db);
  catalogue_close(s->cat);
  s->cat = NULL;
  for (int i = 0; i < 3; i++) {
    snprintf(path, 96, "%s/catalogue.sqlite%s", s->data, suffixes[i]);
    unlink(path);
  }
  snprintf(path, 96, "%s/catalogue.sqlite", s->data);
  assert_int_equal(sqlite3_open(path, &db), SQLITE_OK);
  assert_int_equal(sqlite3_exec(db, first_schema, NULL, NULL, NULL), SQLITE_OK);
  assert_int_equal(sqlite3_exec(db, more, NULL, NULL, NULL), SQLITE_OK);
  sqlite3_close(db);
  return newest;
}

/* A catalogue of schema version 1 with a mesh and two jobs is migrated and keeps them. The request of a waiting job
 * loses the member that no version reads any more. A catalogue of a later version than this program knows is left
 * alone. */
static void test_migrations(void **state) {
  stored *s = *state;
  if (s->url[0]) {
    skip(); /* of files of SQLite */
  }
  static const char first[] =
      "INSERT INTO resource(kind, id, sha, json, bytes, created, used) VALUES(0, 'old', 'sha', '{}', 7, 1, 1);"
      "INSERT INTO job(id, key, kind, state, attempt, listed, priority, cost, owner, request, created)"
      " VALUES('oldjob', 'key', 0, 1, 1, 1, 0, 10, '', '{}', 1);"
      "INSERT INTO job(id, key, kind, state, attempt, listed, priority, cost, owner, request, created)"
      " VALUES('oldmorph', 'key2', 1, 0, 0, 1, 0, 10, '',"
      " '{\"shapes\":[],\"align\":{\"method\":\"pin\",\"options\":{\"preset\":\"fast\",\"seed\":1}}}', 1);"
      "INSERT INTO job(id, key, kind, state, attempt, listed, priority, cost, owner, request, created)"
      " VALUES('oldend', 'key3', 0, 3, 1, 1, 0, 10, '', '{\"a\":1}', 1);"
      "INSERT INTO token VALUES('00', 'old', 1, 100, 0, 1);"
      "PRAGMA user_version=1;";
  char path[96];
  sqlite3 *db = NULL;
  resource got = {0};
  int count = 0;
  int newest = replace_catalogue(s, first, path);
  assert_true(newest >= 4);

  assert_int_equal(catalogue_open(s->data, &s->cat), STORE_OK);
  assert_int_equal(catalogue_get(s->cat, RESOURCE_MESH, "old", &got), STORE_OK);
  assert_int_equal(got.bytes, 7);
  resource_free(&got);
  assert_int_equal(catalogue_bytes(s->cat, 0), 7);
  assert_int_equal(catalogue_bytes(s->cat, 1), 0);
  assert_int_equal(catalogue_recover(s->cat, 3, 20, "{}"), STORE_OK);
  job_row old = {0};
  usage_row used[2];
  char *waiting;
  assert_int_equal(catalogue_job_get(s->cat, "oldjob", &old), STORE_OK);
  assert_int_equal(old.state, API_JOB_QUEUED);
  job_row_free(&old);
  waiting = catalogue_job_request(s->cat, "oldmorph");
  assert_string_equal(waiting, "{\"shapes\":[],\"align\":{\"method\":\"pin\",\"options\":{\"preset\":\"fast\"}}}");
  assert_int_equal(catalogue_usage(s->cat, "", "", 0, 2, used), 1); /* the requests of waiting jobs count */
  assert_int_equal(used[0].derived, strlen(waiting) + strlen("{}"));
  assert_int_equal(catalogue_mismatches(s->cat), 0);
  free(waiting);
  waiting = catalogue_job_request(s->cat, "oldend"); /* that of one that has ended is dropped */
  assert_string_equal(waiting, "{}");
  free(waiting);
  token_row *tokens = catalogue_tokens(s->cat, &count);
  assert_int_equal(count, 1);
  assert_string_equal(tokens[0].name, "old");
  assert_int_equal(tokens[0].used, 0);
  free(tokens);
  assert_true(catalogue_integrity(s->cat));
  catalogue_close(s->cat);
  s->cat = NULL;

  assert_int_equal(sqlite3_open(path, &db), SQLITE_OK);
  assert_int_equal(version_of(db), newest);
  assert_int_equal(sqlite3_exec(db, "PRAGMA user_version=9999", NULL, NULL, NULL), SQLITE_OK);
  sqlite3_close(db);
  assert_int_not_equal(catalogue_open(s->data, &s->cat), STORE_OK);
  s->cat = NULL;
}

static int owns(stored *s, resource_kind kind, const char *id, const char *tenant) {
  resource got = {0};
  store_result result = catalogue_get_of(s->cat, kind, id, tenant, &got);
  resource_free(&got);
  assert_true(result == STORE_OK || result == STORE_NOT_FOUND);
  return result == STORE_OK;
}

/* Returns how many supermeshes the filter finds; each must be "both". */
static int found(stored *s, const char *view, const char *mesh, const char *name) {
  resource rows[2];
  int n = catalogue_list_some(s->cat, RESOURCE_SUPERMESH, view, &(list_filter){.mesh = mesh, .name = name}, 0, 2, rows);
  for (int i = 0; i < n; i++) {
    assert_string_equal(rows[i].id, "both");
    resource_free(&rows[i]);
  }
  return n;
}

/* A catalogue without owners (version 3): results belong to the tenants whose jobs made them, meshes to those whose
 * jobs named them, and everything else only to the operator. A token becomes a tenant of the same name. */
static void test_migration_to_owners(void **state) {
  stored *s = *state;
  if (s->url[0]) {
    skip(); /* of files of SQLite */
  }
  static const char third[] =
      "ALTER TABLE token ADD COLUMN used_bytes INTEGER NOT NULL DEFAULT 0;"
      "ALTER TABLE token ADD COLUMN priority INTEGER NOT NULL DEFAULT 0;"
      "INSERT INTO resource(kind, id, sha, json, bytes, created, used) VALUES"
      " (0, 'cow', 's', '{}', 100, 1, 1), (0, 'dog', 's', '{}', 30, 2, 2), (0, 'unused', 's', '{}', 7, 3, 3),"
      " (1, 'cow-sphere', 's', '{}', 5, 4, 4), (1, 'dog-sphere', 's', '{}', 5, 5, 5), (2, 'both', 's', "
      "  '{\"shapes\":[{\"mesh\":\"cow\",\"name\":\"Kuh\"},{\"mesh\":\"dog\",\"name\":\"Hund\"}]}', 9, 6, 6),"
      " (2, 'broken', 's', 'not JSON', 9, 7, 7);"
      "INSERT INTO job(id, key, kind, state, attempt, listed, priority, cost, owner, request, created) VALUES"
      " ('j1', 'cow-sphere', 0, 2, 1, 1, 0, 10, 'ann', '{\"mesh\":\"cow\",\"options\":{}}', 1),"
      " ('j2', 'both', 1, 2, 1, 1, 0, 10, 'bob', '{\"shapes\":[{\"mesh\":\"cow\"},{\"mesh\":\"dog\"}]}', 2),"
      " ('j3', 'dog-sphere', 0, 2, 1, 0, 0, 10, 'bob', '{\"mesh\":\"dog\"}', 3),"
      " ('j4', 'dog-sphere', 0, 3, 1, 1, 0, 10, 'eve', '{\"mesh\":\"gone\"}', 4),"
      " ('j5', 'key', 1, 4, 1, 1, 0, 10, 'eve', 'not JSON', 5);"
      "INSERT INTO token VALUES('00', 'ann', 3, 100, 0, 1, 12345, 0), ('01', 'bob', 3, 0, 2, 1, 0, 5),"
      " ('02', 'eve', 1, 0, 0, 1, 0, 0);"
      "PRAGMA user_version=3;";
  char path[96];
  int count = 0;
  resource page[4];
  replace_catalogue(s, third, path);
  assert_int_equal(catalogue_open(s->data, &s->cat), STORE_OK);
  static const struct {
    resource_kind kind;
    const char *id, *owners;
  } rows[] = {{RESOURCE_MESH, "cow", "ann,bob"},
              {RESOURCE_MESH, "dog", "bob"},
              {RESOURCE_MESH, "unused", ""},
              {RESOURCE_EMBEDDING, "cow-sphere", "ann"},
              {RESOURCE_EMBEDDING, "dog-sphere", "bob"},
              {RESOURCE_SUPERMESH, "both", "bob"}};
  static const char *const tenants[] = {"ann", "bob", "eve"};
  for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
    for (int t = 0; t < 3; t++) {
      assert_int_equal(owns(s, rows[i].kind, rows[i].id, tenants[t]), strstr(rows[i].owners, tenants[t]) != NULL);
    }
    assert_int_equal(owns(s, rows[i].kind, rows[i].id, ""), rows[i].owners[0] == 0);
  }
  assert_int_equal(catalogue_list_of(s->cat, RESOURCE_MESH, "bob", 0, 4, page), 2); /* the newest first, as before */
  assert_string_equal(page[0].id, "dog");
  assert_string_equal(page[1].id, "cow");
  resource_free(&page[0]);
  resource_free(&page[1]);
  /* The shapes of supermeshes are found, by the tenants that own them. */
  assert_int_equal(found(s, "", "cow", NULL), 1);
  assert_int_equal(found(s, "bob", NULL, "Hund"), 1);
  assert_int_equal(found(s, "bob", "cow", "Hund"), 1);
  assert_int_equal(found(s, "bob", "Hund", NULL) + found(s, "bob", NULL, "cow") + found(s, "ann", "cow", NULL), 0);
  token_row *tokens = catalogue_tokens(s->cat, &count);
  assert_int_equal(count, 3);
  assert_string_equal(tokens[0].tenant, "ann");
  assert_int_equal(tokens[0].used, 100); /* its present meshes, not all that it ever uploaded */
  assert_int_equal(tokens[0].quota, 100);
  assert_int_equal(tokens[1].used, 130);
  assert_int_equal(tokens[1].priority, 5);
  assert_int_equal(tokens[2].used, 0);
  assert_int_equal(tokens[0].derived, 5);
  assert_int_equal(tokens[1].derived, 5 + 9);
  assert_int_equal(tokens[1].quota_derived, 0);
  free(tokens);
  assert_int_equal(catalogue_mismatches(s->cat), 0);
  assert_true(catalogue_integrity(s->cat));
}

/* A catalogue that counted the deaths of a key for the tenant of the last one alone (version BEFORE_TENANTS): what was
 * refused stays refused, and another tenant's death of the same key counts beside the old ones. The rest of the schema
 * is of the present version, whose last step this is: a later step needs a catalogue of its own here. */
static void test_migration_of_crashes(void **state) {
  stored *s = *state;
  enum { BEFORE_TENANTS = 19 };
  if (s->url[0]) {
    skip(); /* of files of SQLite */
  }
  char path[96];
  sqlite3 *db = NULL;
  api_text list = {0};
  catalogue_close(s->cat);
  s->cat = NULL;
  snprintf(path, sizeof path, "%s/catalogue.sqlite", s->data);
  assert_int_equal(sqlite3_open(path, &db), SQLITE_OK);
  assert_int_equal(version_of(db), BEFORE_TENANTS + 2);
  assert_int_equal(sqlite3_exec(db,
                                "DROP TRIGGER job_added; DROP TRIGGER job_removed; DROP TRIGGER job_changed;"
                                "ALTER TABLE job DROP COLUMN request_bytes; ALTER TABLE tenant DROP COLUMN requests;"
                                "DROP TABLE crash;"
                                "CREATE TABLE crash(key TEXT PRIMARY KEY, mesh TEXT NOT NULL, tenant TEXT NOT NULL,"
                                " count INTEGER NOT NULL, last INTEGER NOT NULL) WITHOUT ROWID;"
                                "INSERT INTO crash VALUES('bad', 'cow', 'ann', 3, 7), ('worse', 'dog', 'bob', 2, 8);"
                                "PRAGMA user_version=19;",
                                NULL, NULL, NULL),
                   SQLITE_OK);
  sqlite3_close(db);
  assert_int_equal(catalogue_open(s->data, &s->cat), STORE_OK);
  assert_int_equal(catalogue_crashed(s->cat, "bad"), 1);
  assert_int_equal(catalogue_crashed(s->cat, "worse"), 0);
  catalogue_crash_of_mesh(s->cat, "worse", "eve", 9);
  assert_int_equal(catalogue_crash_clear(s->cat, "none"), STORE_NOT_FOUND); /* waits for the write before */
  assert_int_equal(catalogue_crashed(s->cat, "worse"), 1);
  assert_int_equal(catalogue_crash_list(s->cat, &list), 3);
  assert_non_null(strstr(list.data, "ann"));
  api_text_free(&list);
  assert_int_equal(catalogue_crash_clear(s->cat, "bob"), STORE_OK); /* as of old rows too */
  assert_int_equal(catalogue_crashed(s->cat, "worse"), 0);
  assert_true(catalogue_integrity(s->cat));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(test_migrations, stored_setup, stored_teardown),
      cmocka_unit_test_setup_teardown(test_migration_to_owners, stored_setup, stored_teardown),
      cmocka_unit_test_setup_teardown(test_migration_of_crashes, stored_setup, stored_teardown),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
