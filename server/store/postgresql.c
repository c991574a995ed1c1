/* The driver of PostgreSQL. The SQL that all drivers share has parameters ?1, ?2; this one numbers them $1, $2, and
 * prepares a statement on the server when it is first run: only then are the types of its parameters known. Values go
 * as text. The driver reconnects outside of transactions; a connection that is lost within a transaction fails the
 * transaction.
 *
 * The connection that writes holds an advisory lock, one for each schema, so that one daemon alone works on a
 * catalogue, as the lock of the data folder ensures for SQLite. A lost connection loses the lock. The daemon gets the
 * lock back only if no other daemon has held it meanwhile, which the number `holder` of the catalogue shows. */
#include <ctype.h>
#include <libpq-fe.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "log.h"
#include "store/sql.h"

enum { PARAMETERS = 32, NUMBER = 24, MESSAGE = 400, LOCK_TRIES = 60, OID_BIGINT = 20, OID_TEXT = 25 };
/* Advisory locks; the second key is the schema. */
enum { LOCK = SQL_LOCK, LOCK_OF_SCHEMA = SQL_LOCK + 1 };

#define LOCK_WAIT_NS 50000000

typedef struct connection {
  PGconn *server;
  int writer, out_of_memory;
  int generation; /* counts connections: statements are prepared again on each */
  int statements; /* counts them, for their names */
  int64_t changes, holder;
  char message[MESSAGE];
} connection;

typedef struct statement {
  connection *c;
  char *sql;
  char name[NUMBER];
  int parameters, generation; /* generation: of the connection that it is prepared on; 0: none */
  const char *values[PARAMETERS];
  Oid types[PARAMETERS];
  char numbers[PARAMETERS][NUMBER];
  PGresult *result;
  int row;
  unsigned char *bytes;
} statement;

static int is_state(const char *state, const char *prefix) {
  return strncmp(state, prefix, strlen(prefix)) == 0;
}

/* Notes the error of a result (NULL: of the connection) and returns its code. */
static int failed(connection *c, const PGresult *result) {
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

static int is_fine(const PGresult *result) {
  ExecStatusType status = PQresultStatus(result);
  return status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK;
}

/* Runs one or several statements without parameters. *value: the integer in the first row of the last one; NULL: the
 * caller does not want it. */
static int run(connection *c, const char *sql, int64_t *value) {
  PGresult *result = PQexec(c->server, sql);
  int code = is_fine(result) ? SQL_OK : failed(c, result);
  if (code == SQL_OK && value) {
    *value = PQntuples(result) > 0 ? strtoll(PQgetvalue(result, 0, 0), NULL, 10) : 0;
  }
  PQclear(result);
  return code;
}

/* Notes why the daemon cannot use the database. */
static int refuse(connection *c, int code, const char *why) {
  snprintf(c->message, sizeof c->message, "%s", why);
  return code;
}

/* The server may not have noticed yet that a daemon that died has gone. Nodes share the lock; the first connection of a
 * node also holds the lock of migrations until hold(). */
static int lock(connection *c) {
  char sql[128];
  int64_t locked = 0;
  int code = SQL_OK;
  snprintf(sql, sizeof sql, "SELECT pg_try_advisory_lock%s(%d, hashtext(current_schema()))::int",
           c->writer == SQL_SHARES ? "_shared" : "", LOCK);
  for (int i = 0; i < LOCK_TRIES && code == SQL_OK && !locked; i++) {
    if (i > 0) {
      nanosleep(&(struct timespec){.tv_nsec = LOCK_WAIT_NS}, NULL);
    }
    code = run(c, sql, &locked);
  }
  if (code == SQL_OK && locked && c->writer == SQL_SHARES && c->generation == 1) {
    snprintf(sql, sizeof sql, "SELECT pg_advisory_lock(%d, hashtext(current_schema()))", LOCK_OF_SCHEMA);
    code = run(c, sql, NULL);
  }
  return code == SQL_OK && !locked ? refuse(c, SQL_BUSY, "another orbmorphd uses it") : code;
}

/* Whether this connection may write here, and is the only one. */
static int begin_writer(connection *c) {
  int64_t read_only = 0, schemas = 0, holder = 0;
  if (PQserverVersion(c->server) < 150000) {
    return refuse(c, SQL_SCHEMA, "its server is older than PostgreSQL 15");
  }
  int code = run(c, "SELECT (current_setting('transaction_read_only')='on' OR pg_is_in_recovery())::int", &read_only);
  if (code == SQL_OK && read_only) {
    return refuse(c, SQL_READONLY, "the database is read-only");
  }
  code = code == SQL_OK ? run(c, "SELECT (current_schema() IS NOT NULL)::int", &schemas) : code;
  if (code == SQL_OK && !schemas) {
    return refuse(c, SQL_READONLY, "the search_path has no schema that the user may use");
  }
  code = code == SQL_OK ? lock(c) : code;
  if (code == SQL_OK && c->holder) {
    code = run(c, "SELECT holder FROM catalogue", &holder);
    if (code == SQL_OK && holder != c->holder) {
      return refuse(c, SQL_BUSY, "another orbmorphd has used it meanwhile: restart this one");
    }
  }
  return code;
}

/* Sets up a new connection. pgbouncer passes on no options at the start of a connection, so these are statements. */
static int begin(connection *c) {
  int code = run(c,
                 "SET client_min_messages=warning; SET statement_timeout='60s'; SET lock_timeout='20s';"
                 "SET idle_in_transaction_session_timeout='60s'; SET standard_conforming_strings=on;"
                 "SET timezone='UTC'; SET tcp_keepalives_idle=30; SET tcp_keepalives_interval=10;"
                 "SET tcp_keepalives_count=3",
                 NULL);
  c->generation++;
  if (code == SQL_OK && c->writer == SQL_SHARES) { /* other nodes wait for its transaction */
    code = run(c, "SET idle_in_transaction_session_timeout='5s'", NULL);
  }
  if (code == SQL_OK) {
    code = c->writer ? begin_writer(c) : run(c, "SET default_transaction_read_only=on", NULL);
  }
  return code;
}

/* Whether the last connection that was tried could not be made. __atomic; of all connections of the process. */
static int away;

/* A connection that the network swallows fails only after seconds: while the server is unreachable, one caller tries at
 * a time.
 */
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

static int is_lost(const connection *c) {
  return PQstatus(c->server) != CONNECTION_OK;
}

/* Connects again if the connection was lost. Not within a transaction, whose begin would be lost, too. */
static int restore(connection *c) {
  if (!is_lost(c)) {
    return SQL_OK;
  }
  const int known = sql_postgresql_is_away();
  note_failure();
  if (is_too_soon()) {
    return refuse(c, SQL_IOERR, "the database does not answer");
  }
  PQreset(c->server);
  sql_postgresql_note(PQstatus(c->server) != CONNECTION_OK);
  __atomic_store_n(&tried, now_ms(), __ATOMIC_RELAXED);
  int code = PQstatus(c->server) == CONNECTION_OK ? begin(c) : failed(c, NULL);
  if (code == SQL_OK) {
    log_info("catalogue: connected to the database again");
  } else {
    char why[MESSAGE];
    memcpy(why, c->message, sizeof why);
    if (!known) {
      log_error("catalogue: the connection to the database was lost: %s", why);
    }
    if (PQstatus(c->server) == CONNECTION_OK) {
      run(c, "SELECT pg_terminate_backend(pg_backend_pid())", NULL); /* so that the next call tries again */
    }
  }
  return code;
}

static int is_within(const connection *c) {
  PGTransactionStatusType status = PQtransactionStatus(c->server);
  return status == PQTRANS_INTRANS || status == PQTRANS_INERROR;
}

static int in_transaction(const sql_connection *c) {
  return is_within(c->native);
}

/* A statement that begins a transaction, or needs none, is repeated if the connection was lost. */
static int execute(sql_connection *c, const char *sql) {
  connection *to = c->native;
  int within = in_transaction(c), code = within ? SQL_OK : restore(to);
  code = code == SQL_OK ? run(to, sql, NULL) : code;
  if (code != SQL_OK && !within && is_lost(to) && (code = restore(to)) == SQL_OK) {
    code = run(to, sql, NULL);
  }
  if (code != SQL_OK && !sql_postgresql_is_away()) {
    log_error("catalogue: %.60s: %s", sql, to->message);
  }
  return code;
}

static int open_server(const char *where, int writer, sql_connection *out) {
  static const char *const names[] = {"connect_timeout",
                                      "fallback_application_name",
                                      "keepalives_idle",
                                      "tcp_user_timeout",
                                      "client_encoding",
                                      "dbname",
                                      NULL};
  const char *const values[] = {"10", "orbmorphd", "30", "15000", "UTF8", where, NULL};
  connection *c = calloc(1, sizeof *c);
  *out = (sql_connection){&sql_postgresql, c};
  if (!c) {
    return SQL_NOMEM;
  }
  c->writer = writer;
  c->server = PQconnectdbParams(names, values, 1);
  int code = c->server && PQstatus(c->server) == CONNECTION_OK ? begin(c) : failed(c, NULL);
  if (c->server && PQstatus(c->server) != CONNECTION_OK) {
    /* A server that is there refuses this user, this password or this database. */
    PGPing ping = PQpingParams(names, values, 1);
    code = ping == PQPING_OK || ping == PQPING_NO_ATTEMPT ? SQL_NOTADB : SQL_CANTOPEN;
  }
  if (code != SQL_OK) {
    log_error("the catalogue in PostgreSQL cannot be opened: %s", c->message);
  }
  return code;
}

static void close_server(sql_connection *c) {
  connection *to = c->native;
  if (to) {
    PQfinish(to->server);
    free(to);
  }
  c->native = NULL;
}

static const char *message(const sql_connection *c) {
  return ((const connection *)c->native)->message;
}

static int out_of_memory(const sql_connection *c) {
  return ((const connection *)c->native)->out_of_memory;
}

static int64_t changes(const sql_connection *c) {
  return ((const connection *)c->native)->changes;
}

/* The same SQL with parameters as this server numbers them, and how many there are. */
static char *renumber(const char *sql, int *parameters) {
  char *copy = strdup(sql);
  int quoted = 0;
  *parameters = 0;
  for (char *at = copy; at && *at; at++) {
    quoted ^= *at == '\'';
    if (!quoted && at[0] == '?' && isdigit((unsigned char)at[1])) {
      int number = (int)strtol(at + 1, NULL, 10);
      *at = '$';
      *parameters = number > *parameters ? number : *parameters;
    }
  }
  return copy;
}

static int prepare(sql_connection *c, const char *sql, sql_statement *out) {
  connection *to = c->native;
  statement *st = calloc(1, sizeof *st);
  *out = (sql_statement){&sql_postgresql, NULL};
  if (st) {
    st->c = to;
    st->sql = renumber(sql, &st->parameters);
    snprintf(st->name, sizeof st->name, "s%d", ++to->statements);
  }
  if (!st || !st->sql || st->parameters > PARAMETERS) {
    snprintf(to->message, sizeof to->message, "out of memory");
    to->out_of_memory = 1;
    free(st ? st->sql : NULL);
    free(st);
    return SQL_NOMEM;
  }
  out->native = st;
  return SQL_OK;
}

static void drop_result(statement *st) {
  PQclear(st->result);
  PQfreemem(st->bytes);
  st->result = NULL;
  st->bytes = NULL;
  st->row = -1;
}

static void finish(sql_statement *s) {
  statement *st = s->native;
  if (st) {
    drop_result(st);
    free(st->sql);
    free(st);
  }
  s->native = NULL;
}

static void clear(sql_statement *s) {
  statement *st = s->native;
  for (int i = 0; i < PARAMETERS; i++) {
    st->values[i] = NULL;
  }
}

static void reset(sql_statement *s) {
  drop_result(s->native);
}

/* A parameter that the SQL does not have is ignored. NULL is always that of a text. */
static void bind(statement *st, int parameter, const char *value, Oid type) {
  if (parameter <= st->parameters) {
    st->values[parameter - 1] = value;
    st->types[parameter - 1] = type;
  }
}

static void bind_text(sql_statement *s, int parameter, const char *text) {
  bind(s->native, parameter, text, OID_TEXT);
}

static void bind_integer(sql_statement *s, int parameter, int64_t value) {
  statement *st = s->native;
  if (parameter <= st->parameters) {
    snprintf(st->numbers[parameter - 1], NUMBER, "%lld", (long long)value);
    bind(st, parameter, st->numbers[parameter - 1], OID_BIGINT);
  }
}

static int prepare_on_server(statement *st) {
  if (st->generation == st->c->generation) {
    return SQL_OK;
  }
  for (int i = 0; i < st->parameters; i++) {
    st->types[i] = st->types[i] ? st->types[i] : OID_TEXT;
  }
  PGresult *result = PQprepare(st->c->server, st->name, st->sql, st->parameters, st->types);
  int code = is_fine(result) ? SQL_OK : failed(st->c, result);
  PQclear(result);
  st->generation = code == SQL_OK ? st->c->generation : 0;
  return code;
}

static int run_prepared(statement *st) {
  connection *c = st->c;
  int code = prepare_on_server(st);
  if (code != SQL_OK) {
    return code;
  }
  st->result = PQexecPrepared(c->server, st->name, st->parameters, st->values, NULL, NULL, 0);
  if (!is_fine(st->result)) {
    return failed(c, st->result);
  }
  if (PQresultStatus(st->result) == PGRES_COMMAND_OK) {
    c->changes = strtoll(PQcmdTuples(st->result), NULL, 10);
  }
  return SQL_OK;
}

/* A query outside of transactions is repeated if the connection was lost: it only reads. */
static int first_step(statement *st) {
  connection *c = st->c;
  int within = is_within(c), code = within ? SQL_OK : restore(c);
  code = code == SQL_OK ? run_prepared(st) : code;
  if (code != SQL_OK && !within && is_lost(c) && (code = restore(c)) == SQL_OK) {
    drop_result(st);
    code = run_prepared(st);
  }
  return code;
}

static int step(sql_statement *s) {
  statement *st = s->native;
  int code = st->result ? SQL_OK : first_step(st);
  if (code == SQL_OK && ++st->row < PQntuples(st->result)) {
    return SQL_ROW;
  }
  return code == SQL_OK ? SQL_DONE : code;
}

static int is_null(sql_statement *s, int column) {
  const statement *st = s->native;
  return PQgetisnull(st->result, st->row, column);
}

static int64_t integer(sql_statement *s, int column) {
  const statement *st = s->native;
  return strtoll(PQgetvalue(st->result, st->row, column), NULL, 10);
}

static const char *text(sql_statement *s, int column) {
  const statement *st = s->native;
  return is_null(s, column) ? NULL : PQgetvalue(st->result, st->row, column);
}

static const void *bytes(sql_statement *s, int column, int *size) {
  statement *st = s->native;
  size_t found = 0;
  PQfreemem(st->bytes);
  st->bytes = PQunescapeBytea((const unsigned char *)PQgetvalue(st->result, st->row, column), &found);
  *size = st->bytes && found <= INT32_MAX ? (int)found : 0;
  return st->bytes;
}

static int version(sql_connection *c, int *version) {
  int64_t found = 0;
  int code = run(c->native, "SELECT (to_regclass('catalogue') IS NOT NULL)::int", &found);
  if (code == SQL_OK && found) {
    code = run(c->native, "SELECT schema FROM catalogue", &found);
  }
  *version = found < INT32_MAX ? (int)found : INT32_MAX;
  return code;
}

/* Numbers the daemon that holds the lock alone. */
static int hold(sql_connection *c) {
  connection *to = c->native;
  char sql[96];
  if (to->writer == SQL_SHARES) {
    snprintf(sql, sizeof sql, "SELECT pg_advisory_unlock(%d, hashtext(current_schema()))", LOCK_OF_SCHEMA);
    return run(to, sql, NULL);
  }
  return run(to, "UPDATE catalogue SET holder=holder+1 RETURNING holder", &to->holder);
}

const sql_driver sql_postgresql = {
    .open = open_server,
    .close = close_server,
    .message = message,
    .out_of_memory = out_of_memory,
    .execute = execute,
    .in_transaction = in_transaction,
    .version = version,
    .hold = hold,
    .changes = changes,
    .prepare = prepare,
    .finish = finish,
    .clear = clear,
    .reset = reset,
    .bind_text = bind_text,
    .bind_integer = bind_integer,
    .step = step,
    .is_null = is_null,
    .integer = integer,
    .text = text,
    .bytes = bytes,
};
