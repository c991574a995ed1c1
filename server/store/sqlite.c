/* The driver of SQLite. */
#include <pthread.h>
#include <sqlite3.h>

#include "log.h"
#include "store/sql.h"

static int is_damaged; /* __atomic */

int sql_sqlite_is_damaged(void) {
  return __atomic_load_n(&is_damaged, __ATOMIC_ACQUIRE);
}

/* Logs the first time only, and before others see it: each statement that meets the page comes here. */
static int found_damage(int code) {
  static int is_logged; /* __atomic */
  if (!__atomic_exchange_n(&is_logged, 1, __ATOMIC_RELAXED)) {
    log_error("the catalogue is damaged: SQLite cannot use a page of it. Stop the daemon and restore a backup");
  }
  __atomic_store_n(&is_damaged, 1, __ATOMIC_RELEASE);
  return code;
}

static int code_of(int code) {
  switch (code & 0xff) {
    case SQLITE_OK:
      return SQL_OK;
    case SQLITE_ROW:
      return SQL_ROW;
    case SQLITE_DONE:
      return SQL_DONE;
    case SQLITE_CONSTRAINT:
      return SQL_CONSTRAINT;
    case SQLITE_NOMEM:
      return SQL_NOMEM;
    case SQLITE_FULL:
      return SQL_FULL;
    case SQLITE_IOERR:
      return SQL_IOERR;
    case SQLITE_BUSY:
      return SQL_BUSY;
    case SQLITE_READONLY:
      return SQL_READONLY;
    case SQLITE_CANTOPEN:
      return SQL_CANTOPEN;
    case SQLITE_CORRUPT:
      return found_damage(SQL_CORRUPT);
    case SQLITE_NOTADB:
      return found_damage(SQL_NOTADB);
    default:
      return SQL_ERROR;
  }
}

static int execute(sql_connection *c, const char *sql) {
  char *message = NULL;
  int code = sqlite3_exec(c->native, sql, NULL, NULL, &message);
  if (code != SQLITE_OK) {
    log_error("catalogue: %.60s: %s", sql, message ? message : sqlite3_errstr(code));
  }
  sqlite3_free(message);
  return code_of(code);
}

/* The pages that savepoints keep, those of a few jobs, stay in memory, however many. By default SQLite writes more than
 * 64 KiB to a file in /var/tmp. That takes longer than the write of a small job itself, and version 3.40 sometimes
 * fails there with SQLITE_FULL: it writes an empty last piece and takes the 0 bytes for a full disk. */
static void keep_savepoints_in_memory(void) {
  enum { NEVER = -1 };
  sqlite3_config(SQLITE_CONFIG_STMTJRNL_SPILL, NEVER);
}

static int open_file(const char *where, int writer, sql_connection *out) {
  static pthread_once_t once = PTHREAD_ONCE_INIT;
  sqlite3 *handle = NULL;
  pthread_once(&once, keep_savepoints_in_memory);
  int flags = SQLITE_OPEN_NOMUTEX | (writer ? SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE : SQLITE_OPEN_READONLY);
  int code = sqlite3_open_v2(where, &handle, flags, NULL);
  *out = (sql_connection){&sql_sqlite, handle};
  if (code != SQLITE_OK) {
    return code_of(code);
  }
  sqlite3_busy_timeout(handle, 5000);
  sqlite3_db_config(handle, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, writer ? 0 : 1, NULL);
  return execute(out, writer ? "PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; PRAGMA foreign_keys=ON;"
                               "PRAGMA wal_autocheckpoint=1000; PRAGMA journal_size_limit=67108864;"
                             : "PRAGMA query_only=ON; PRAGMA wal_autocheckpoint=0;");
}

static void close_file(sql_connection *c) {
  sqlite3_close(c->native);
  c->native = NULL;
}

static const char *message(const sql_connection *c) {
  return sqlite3_errmsg(c->native);
}

static int out_of_memory(const sql_connection *c) {
  return (sqlite3_errcode(c->native) & 0xff) == SQLITE_NOMEM;
}

static int in_transaction(const sql_connection *c) {
  return !sqlite3_get_autocommit(c->native);
}

static int64_t changes(const sql_connection *c) {
  return sqlite3_changes(c->native);
}

static int prepare(sql_connection *c, const char *sql, sql_statement *out) {
  sqlite3_stmt *st = NULL;
  int code = sqlite3_prepare_v3(c->native, sql, -1, SQLITE_PREPARE_PERSISTENT, &st, NULL);
  *out = (sql_statement){&sql_sqlite, code == SQLITE_OK ? st : NULL};
  return code_of(code);
}

static void finish(sql_statement *st) {
  sqlite3_finalize(st->native);
  st->native = NULL;
}

static void clear(sql_statement *st) {
  sqlite3_clear_bindings(st->native);
}

static void reset(sql_statement *st) {
  sqlite3_reset(st->native);
}

static void bind_text(sql_statement *st, int parameter, const char *text) {
  sqlite3_bind_text(st->native, parameter, text, -1, SQLITE_STATIC);
}

static void bind_integer(sql_statement *st, int parameter, int64_t value) {
  sqlite3_bind_int64(st->native, parameter, value);
}

static int step(sql_statement *st) {
  return code_of(sqlite3_step(st->native));
}

static int begin(sql_connection *c) {
  return execute(c, "BEGIN IMMEDIATE");
}

static int later(sql_statement *st, sql_expect expect) {
  sqlite3_stmt *native = st->native;
  int code = step(st);
  const int lost = code == SQL_ROW && expect == SQL_ZERO && sqlite3_column_int64(native, 0) != 0;
  reset(st);
  code = code == SQL_ROW || code == SQL_DONE ? SQL_OK : code;
  return code != SQL_OK                                                                ? code
         : lost                                                                        ? SQL_LOST
         : expect == SQL_ONE_CHANGE && sqlite3_changes(sqlite3_db_handle(native)) != 1 ? SQL_CONSTRAINT
                                                                                       : SQL_OK;
}

static int settle(sql_connection *c) {
  (void)c;
  return SQL_OK;
}

static int is_null(sql_statement *st, int column) {
  return sqlite3_column_type(st->native, column) == SQLITE_NULL;
}

static int64_t integer(sql_statement *st, int column) {
  return sqlite3_column_int64(st->native, column);
}

static const char *text(sql_statement *st, int column) {
  return (const char *)sqlite3_column_text(st->native, column);
}

static const void *bytes(sql_statement *st, int column, int *size) {
  const void *found = sqlite3_column_blob(st->native, column);
  *size = sqlite3_column_bytes(st->native, column);
  return found;
}

static int version(sql_connection *c, int *version) {
  sqlite3_stmt *st = NULL;
  int code = sqlite3_prepare_v3(c->native, "PRAGMA user_version", -1, 0, &st, NULL);
  code = code == SQLITE_OK ? sqlite3_step(st) : code;
  *version = code == SQLITE_ROW ? sqlite3_column_int(st, 0) : 0;
  sqlite3_finalize(st);
  return code == SQLITE_ROW ? SQL_OK : SQL_ERROR;
}

/* The lock of the data folder ensures that one daemon alone writes. */
static int exclude(sql_connection *c) {
  (void)c;
  return SQL_OK;
}

static int hold(sql_connection *c) {
  (void)c;
  return SQL_OK;
}

const sql_driver sql_sqlite = {
    .open = open_file,
    .close = close_file,
    .message = message,
    .out_of_memory = out_of_memory,
    .execute = execute,
    .begin = begin,
    .in_transaction = in_transaction,
    .version = version,
    .exclude = exclude,
    .hold = hold,
    .changes = changes,
    .prepare = prepare,
    .finish = finish,
    .clear = clear,
    .reset = reset,
    .bind_text = bind_text,
    .bind_integer = bind_integer,
    .step = step,
    .later = later,
    .settle = settle,
    .is_null = is_null,
    .integer = integer,
    .text = text,
    .bytes = bytes,
};
