#include "store/snapshot.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "store/rows.h"

struct snapshot {
  database db;
};

static int quick_check(database *db) {
  sql_statement *st = database_statement(db, "PRAGMA quick_check(1)");
  int fine = st && sql_step(st) == SQL_ROW && strcmp(sql_text(st, 0), "ok") == 0;
  sql_reset(st);
  return fine;
}

/* The connection only reads. It neither writes the catalogue nor checkpoints its WAL; only the daemon does that. */
static int vacuum_into(const char *from, const char *path) {
  database db;
  int code = database_open(from, 0, &db);
  if (code == SQL_OK) {
    code = database_execute(
        &db, "PRAGMA query_only=OFF"); /* query_only would refuse VACUUM INTO; the file is opened for reading */
    sql_statement *st = database_statement(&db, "VACUUM INTO ?1");
    if (code == SQL_OK && st) {
      sql_bind_text(st, 1, path);
    }
    code = code == SQL_OK ? database_run(&db, st) : code;
    database_close(&db);
  }
  return code;
}

/* Without a WAL, so that the file is whole and can be read from a medium that cannot be written. */
static int make_current(const char *path, const char *from) {
  database db;
  int code = database_open(path, 1, &db);
  if (code != SQL_OK) {
    return code;
  }
  if (!quick_check(&db)) {
    log_error("the catalogue %s is damaged: restore a backup, or see orbmorphd --check-data", from);
    code = SQL_CORRUPT;
  }
  code = code == SQL_OK ? database_migrate(&db) : code;
  code = code == SQL_OK ? database_execute(&db, "PRAGMA journal_mode=DELETE") : code;
  database_close(&db);
  return code;
}

static store_result sync_file(const char *path) {
  int fd = open(path, O_RDONLY | O_CLOEXEC);
  int fine = fd >= 0 && fsync(fd) == 0;
  if (fd >= 0) {
    close(fd);
  }
  return fine ? STORE_OK : STORE_ERROR;
}

/* Empties the file, so that its name stays, and deletes what SQLite had beside it when the process was killed. */
static void discard(const char *path) {
  static const char *const tails[] = {"-journal", "-wal", "-shm"};
  for (size_t i = 0; i < sizeof tails / sizeof tails[0]; i++) {
    char beside[PATH_MAX];
    if (snprintf(beside, sizeof beside, "%s%s", path, tails[i]) < (int)sizeof beside) {
      unlink(beside);
    }
  }
  if (truncate(path, 0) != 0 && errno != ENOENT) {
    log_error("%s cannot be emptied: %s", path, strerror(errno));
  }
}

store_result snapshot_take(const char *data, const char *path) {
  char from[PATH_MAX];
  snprintf(from, sizeof from, "%s/catalogue.sqlite", data);
  discard(path);
  int code = vacuum_into(from, path);
  code = code == SQL_OK ? make_current(path, from) : code;
  if (code == SQL_OK && sync_file(path) == STORE_OK) {
    return STORE_OK;
  }
  log_error("the catalogue %s cannot be copied to %s: %s", from, path, sql_reason(code));
  discard(path);
  return code == SQL_FULL ? STORE_FULL : STORE_ERROR;
}

store_result snapshot_requeue(const char *path) {
  database db;
  int code = database_open(path, 1, &db);
  if (code == SQL_OK) {
    code = database_execute(&db, "UPDATE job SET state=0, attempt=max(attempt-1, 0), alone=0 WHERE state=1");
    code = code == SQL_OK ? database_execute(&db, "PRAGMA journal_mode=DELETE") : code;
    database_close(&db);
  }
  return code == SQL_OK ? sync_file(path) : STORE_ERROR;
}

store_result snapshot_open(const char *path, snapshot **out) {
  snapshot *s = calloc(1, sizeof *s);
  if (!s || database_open(path, 0, &s->db) != SQL_OK) {
    free(s);
    return STORE_ERROR;
  }
  *out = s;
  return STORE_OK;
}

void snapshot_close(snapshot *s) {
  if (s) {
    database_close(&s->db);
  }
  free(s);
}

store_result snapshot_each(snapshot *s, void (*each)(void *user, const resource *row), void *user) {
  sql_statement *st = database_statement(&s->db,
                                         "SELECT seq, kind, id, sha, json, bytes, created, places, quantized, meshopt"
                                         " FROM resource ORDER BY seq");
  int code = st ? SQL_ROW : SQL_ERROR;
  while (code == SQL_ROW && (code = sql_step(st)) == SQL_ROW) {
    resource row;
    if (resource_rows.read(st, &row) && row.kind >= 0 && row.kind < RESOURCE_KINDS) {
      each(user, &row);
    } else {
      code = SQL_CORRUPT;
    }
    resource_free(&row);
  }
  sql_reset(st);
  if (code != SQL_DONE) {
    log_error("catalogue: rows cannot be read: %s", sql_reason(code));
  }
  return code == SQL_DONE ? STORE_OK : STORE_ERROR;
}

int snapshot_names(snapshot *s, object_kind kind, const char *id) {
  sql_statement *st = database_statement(&s->db, "SELECT 1 FROM resource WHERE kind=?1 AND id=?2");
  if (!st) {
    return 1;
  }
  sql_bind_integer(st, 1, (int)resource_of_object(kind));
  sql_bind_text(st, 2, id);
  int code = sql_step(st);
  sql_reset(st);
  return code != SQL_DONE;
}
