#include "store/postgresql_connection.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "log.h"
#include "store/sql.h"

/* Advisory locks; the second key is the schema. */
enum { LOCK = SQL_LOCK, LOCK_OF_SCHEMA = SQL_LOCK + 1 };

/* Attempts to take the lock, 3 s in all. A daemon that died holds it until the server notices. */
enum { LOCK_TRIES = 60 };
#define LOCK_WAIT_NS 50000000

static int is_state(const char *state, const char *prefix) {
  return strncmp(state, prefix, strlen(prefix)) == 0;
}

int pgsql_failed(pgsql_connection *c, const PGresult *result) {
  const char *state = result ? PQresultErrorField(result, PG_DIAG_SQLSTATE) : NULL;
  const char *said = result ? PQresultErrorField(result, PG_DIAG_MESSAGE_PRIMARY) : NULL;
  snprintf(c->message, sizeof c->message, "%s", said ? said : PQerrorMessage(c->server));
  c->message[strcspn(c->message, "\n")] = 0;
  state = state ? state : "";
  c->out_of_memory = is_state(state, "53200") || (!result && PQstatus(c->server) == CONNECTION_OK);
  return is_state(state, "23")                                       ? SQL_CONSTRAINT
         : is_state(state, "53100")                                  ? SQL_FULL
         : c->out_of_memory                                          ? SQL_NOMEM
         : is_state(state, "25006") || is_state(state, "42501")      ? SQL_READONLY
         : is_state(state, "55P03") || is_state(state, "40")         ? SQL_BUSY
         : is_state(state, "XX001") || is_state(state, "XX002")      ? SQL_CORRUPT
         : is_state(state, "57") || is_state(state, "08") || !*state ? SQL_IOERR
                                                                     : SQL_ERROR;
}

int pgsql_is_fine(const PGresult *result) {
  ExecStatusType status = PQresultStatus(result);
  return status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK;
}

int pgsql_run(pgsql_connection *c, const char *sql, int64_t *value) {
  PGresult *result = PQexec(c->server, sql);
  int code = pgsql_is_fine(result) ? SQL_OK : pgsql_failed(c, result);
  if (code == SQL_OK && value) {
    *value = PQntuples(result) > 0 ? strtoll(PQgetvalue(result, 0, 0), NULL, 10) : 0;
  }
  PQclear(result);
  return code;
}

/* Notes why the daemon cannot use the database. */
static int refuse(pgsql_connection *c, int code, const char *why) {
  snprintf(c->message, sizeof c->message, "%s", why);
  return code;
}

static int take_lock(pgsql_connection *c, int shared) {
  char sql[128];
  int64_t locked = 0;
  int code = SQL_OK;
  snprintf(sql, sizeof sql, "SELECT pg_try_advisory_lock%s(%d, hashtext(current_schema()))::int",
           shared ? "_shared" : "", LOCK);
  for (int i = 0; i < LOCK_TRIES && code == SQL_OK && !locked; i++) {
    if (i > 0) {
      nanosleep(&(struct timespec){.tv_nsec = LOCK_WAIT_NS}, NULL);
    }
    code = pgsql_run(c, sql, &locked);
  }
  return code == SQL_OK && !locked ? refuse(c, SQL_BUSY, "another orbmorphd uses it") : code;
}

/* Nodes share the lock. The first connection of a node also holds the lock of migrations until pgsql_hold(). It takes
 * that one first, so that nodes that wait for a migration do not keep it from excluding the nodes that run. */
static int lock(pgsql_connection *c) {
  char sql[128];
  int code = SQL_OK;
  if (c->writer == SQL_SHARES && c->generation == 1) {
    snprintf(sql, sizeof sql, "SELECT pg_advisory_lock(%d, hashtext(current_schema()))", LOCK_OF_SCHEMA);
    code = pgsql_run(c, sql, NULL);
  }
  return code == SQL_OK ? take_lock(c, c->writer == SQL_SHARES) : code;
}

static int taken; /* another daemon has used the catalogue since this one opened it; __atomic */

/* Checks that this connection may write here, and that it is the only one. */
static int begin_writer(pgsql_connection *c) {
  int64_t read_only = 0, schemas = 0, holder = 0;
  if (PQserverVersion(c->server) < 150000) {
    return refuse(c, SQL_SCHEMA, "its server is older than PostgreSQL 15");
  }
  int code =
      pgsql_run(c, "SELECT (current_setting('transaction_read_only')='on' OR pg_is_in_recovery())::int", &read_only);
  if (code == SQL_OK && read_only) {
    return refuse(c, SQL_READONLY, "the database is read-only");
  }
  code = code == SQL_OK ? pgsql_run(c, "SELECT (current_schema() IS NOT NULL)::int", &schemas) : code;
  if (code == SQL_OK && !schemas) {
    return refuse(c, SQL_READONLY, "the search_path has no schema that the user may use");
  }
  code = code == SQL_OK ? lock(c) : code;
  if (code == SQL_OK && c->holder) {
    code = pgsql_run(c, "SELECT holder FROM catalogue", &holder);
    const int is_taken = code == SQL_OK && holder != c->holder;
    __atomic_store_n(&taken, is_taken, __ATOMIC_RELAXED);
    if (is_taken) {
      return refuse(c, SQL_BUSY, "another orbmorphd has used it meanwhile: restart this one");
    }
  }
  return code;
}

/* Sets up a new connection. pgbouncer does not pass on options at the start of a connection, so they are set by
 * statements. */
static int begin(pgsql_connection *c) {
  int code = pgsql_run(c,
                       "SET client_min_messages=warning; SET statement_timeout='60s'; SET lock_timeout='20s';"
                       "SET idle_in_transaction_session_timeout='60s'; SET standard_conforming_strings=on;"
                       "SET timezone='UTC'; SET tcp_keepalives_idle=30; SET tcp_keepalives_interval=10;"
                       "SET tcp_keepalives_count=3",
                       NULL);
  c->generation++;
  c->excludes = 0;
  if (code == SQL_OK && c->writer == SQL_SHARES) { /* other nodes wait for its transaction */
    code = pgsql_run(c, "SET idle_in_transaction_session_timeout='5s'", NULL);
  }
  if (code == SQL_OK) {
    code = c->writer ? begin_writer(c) : pgsql_run(c, "SET default_transaction_read_only=on", NULL);
  }
  return code;
}

/* Whether the last connection that was tried could not be made. __atomic; of all connections of the process. */
static int away;

/* An attempt to connect over a network that drops packets fails only after seconds. So while the server is unreachable,
 * only one caller tries at a time. */
enum { AGAIN_MS = 500 };
static int64_t tried; /* when a connection was last tried in vain; __atomic */

static int64_t now_ms(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

static int is_too_soon(void) {
  int64_t last = __atomic_load_n(&tried, __ATOMIC_RELAXED), now = now_ms();
  return sql_postgresql_is_away() &&
         (now - last < AGAIN_MS ||
          !__atomic_compare_exchange_n(&tried, &last, now, 0, __ATOMIC_RELAXED, __ATOMIC_RELAXED));
}

int sql_postgresql_is_taken(void) {
  return __atomic_load_n(&taken, __ATOMIC_RELAXED);
}

int sql_postgresql_is_away(void) {
  return __atomic_load_n(&away, __ATOMIC_RELAXED);
}

static int64_t failed_at; /* when it last did not answer, or a connection was found lost, as now_ms(); __atomic */

int64_t sql_postgresql_failed_at(void) {
  return __atomic_load_n(&failed_at, __ATOMIC_RELAXED);
}

static void note_failure(void) {
  __atomic_store_n(&failed_at, now_ms(), __ATOMIC_RELAXED);
}

void sql_postgresql_note(int is_away) {
  if (is_away) {
    note_failure();
  }
  __atomic_store_n(&away, is_away, __ATOMIC_RELAXED);
}

int pgsql_is_lost(const pgsql_connection *c) {
  return c->broken || PQstatus(c->server) != CONNECTION_OK;
}

int pgsql_restore(pgsql_connection *c) {
  if (!pgsql_is_lost(c)) {
    return SQL_OK;
  }
  const int known = sql_postgresql_is_away();
  note_failure();
  if (is_too_soon()) {
    return refuse(c, SQL_IOERR, "the database does not answer");
  }
  PQreset(c->server);
  c->broken = 0;
  __atomic_store_n(&tried, now_ms(), __ATOMIC_RELAXED);
  int code = PQstatus(c->server) == CONNECTION_OK ? begin(c) : pgsql_failed(c, NULL);
  sql_postgresql_note(PQstatus(c->server) != CONNECTION_OK); /* pgbouncer takes connections also without the server */
  if (code == SQL_OK) {
    log_info("catalogue: connected to the database again");
  } else {
    char why[sizeof c->message];
    memcpy(why, c->message, sizeof why);
    if (!known) {
      log_error("catalogue: the connection to the database was lost: %s", why);
    }
    if (PQstatus(c->server) == CONNECTION_OK) {
      pgsql_run(c, "SELECT pg_terminate_backend(pg_backend_pid())", NULL); /* so that the next call tries again */
    }
  }
  return code;
}

int pgsql_is_within(const pgsql_connection *c) {
  PGTransactionStatusType status = PQtransactionStatus(c->server);
  return c->begun || status == PQTRANS_INTRANS || status == PQTRANS_INERROR;
}

int pgsql_open(const char *where, int writer, pgsql_connection **out) {
  static const char *const names[] = {"connect_timeout",
                                      "fallback_application_name",
                                      "keepalives_idle",
                                      "tcp_user_timeout",
                                      "client_encoding",
                                      "dbname",
                                      NULL};
  const char *const values[] = {"10", "orbmorphd", "30", "15000", "UTF8", where, NULL};
  pgsql_connection *c = calloc(1, sizeof *c);
  *out = c;
  if (!c) {
    return SQL_NOMEM;
  }
  c->writer = writer;
  c->server = PQconnectdbParams(names, values, 1);
  int code = c->server && PQstatus(c->server) == CONNECTION_OK ? begin(c) : pgsql_failed(c, NULL);
  if (c->server && PQstatus(c->server) != CONNECTION_OK) {
    /* Whether the server answered and refused this user, this password or this database. */
    PGPing ping = PQpingParams(names, values, 1);
    code = ping == PQPING_OK || ping == PQPING_NO_ATTEMPT ? SQL_NOTADB : SQL_CANTOPEN;
  }
  if (code != SQL_OK) {
    log_error("the catalogue in PostgreSQL cannot be opened: %s", c->message);
  }
  return code;
}

void pgsql_close(pgsql_connection *c) {
  if (c) {
    PQfinish(c->server);
    free(c);
  }
}

int pgsql_exclude(pgsql_connection *c) {
  int code = c->writer == SQL_SHARES ? take_lock(c, 0) : SQL_OK;
  c->excludes = c->writer == SQL_SHARES && code == SQL_OK;
  return code;
}

static int unlock(pgsql_connection *c, int which) {
  char sql[96];
  snprintf(sql, sizeof sql, "SELECT pg_advisory_unlock(%d, hashtext(current_schema()))", which);
  return pgsql_run(c, sql, NULL);
}

int pgsql_hold(pgsql_connection *to) {
  if (to->writer == SQL_SHARES) {
    int code = to->excludes ? unlock(to, LOCK) : SQL_OK;
    to->excludes = 0;
    return code == SQL_OK ? unlock(to, LOCK_OF_SCHEMA) : code;
  }
  return pgsql_run(to, "UPDATE catalogue SET holder=holder+1 RETURNING holder", &to->holder);
}
