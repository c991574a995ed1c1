/* The driver of PostgreSQL. The SQL that all drivers share has parameters ?1, ?2; this one numbers them $1, $2, and
 * prepares a statement on the server when it is first run: only then are the types of its parameters known. Values go
 * as text. The driver reconnects outside of transactions; a connection that is lost within a transaction fails the
 * transaction. */
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "log.h"
#include "store/postgresql_connection.h"
#include "store/postgresql_pipeline.h"
#include "store/sql.h"

enum { PARAMETERS = 32, NUMBER = 24, OID_BIGINT = 20, OID_TEXT = 25 };

typedef struct statement {
  pgsql_connection *c;
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

static int open_server(const char *where, int writer, sql_connection *out) {
  pgsql_connection *c;
  int code = pgsql_open(where, writer, &c);
  *out = (sql_connection){&sql_postgresql, c};
  return code;
}

static void close_server(sql_connection *c) {
  pgsql_close(c->native);
  c->native = NULL;
}

static int exclude(sql_connection *c) {
  return pgsql_exclude(c->native);
}

static int hold(sql_connection *c) {
  return pgsql_hold(c->native);
}

static int in_transaction(const sql_connection *c) {
  return pgsql_is_within(c->native);
}

/* A statement that begins a transaction, or needs none, is repeated if the connection was lost. */
static int execute(sql_connection *c, const char *sql) {
  pgsql_connection *to = c->native;
  int within = in_transaction(c), code = pgsql_settle(to, NULL);
  code = code != SQL_OK || within ? code : pgsql_restore(to);
  code = code == SQL_OK ? pgsql_run(to, sql, NULL) : code;
  if (code != SQL_OK && !within && pgsql_is_lost(to) && (code = pgsql_restore(to)) == SQL_OK) {
    code = pgsql_run(to, sql, NULL);
  }
  if (code != SQL_OK && code != SQL_CONSTRAINT && code != SQL_LOST && !sql_postgresql_is_away()) {
    log_error("catalogue: %.60s: %s", sql, to->message);
  }
  return code;
}

static int begin(sql_connection *c) {
  pgsql_connection *to = c->native;
  int code = pgsql_settle(to, NULL);
  code = code == SQL_OK ? pgsql_restore(to) : code;
  return code == SQL_OK ? pgsql_send_begin(to, to->writer == SQL_SHARES) : code;
}

static int settle(sql_connection *c) {
  return pgsql_settle(c->native, NULL);
}

static const char *message(const sql_connection *c) {
  return ((const pgsql_connection *)c->native)->message;
}

static int out_of_memory(const sql_connection *c) {
  return ((const pgsql_connection *)c->native)->out_of_memory;
}

static int64_t changes(const sql_connection *c) {
  return ((const pgsql_connection *)c->native)->changes;
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
  pgsql_connection *to = c->native;
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
    pgsql_forget(st->c, &st->generation);
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

/* Ignores a parameter that the SQL does not have. NULL always has the type text. */
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

static void settle_types(statement *st) {
  for (int i = 0; i < st->parameters; i++) {
    st->types[i] = st->types[i] ? st->types[i] : OID_TEXT;
  }
}

static int prepare_on_server(statement *st) {
  if (st->generation == st->c->generation) {
    return SQL_OK;
  }
  settle_types(st);
  PGresult *result = PQprepare(st->c->server, st->name, st->sql, st->parameters, st->types);
  int code = pgsql_is_fine(result) ? SQL_OK : pgsql_failed(st->c, result);
  PQclear(result);
  st->generation = code == SQL_OK ? st->c->generation : 0;
  return code;
}

static int run_prepared(statement *st) {
  pgsql_connection *c = st->c;
  int code = prepare_on_server(st);
  if (code != SQL_OK) {
    return code;
  }
  st->result = PQexecPrepared(c->server, st->name, st->parameters, st->values, NULL, NULL, 0);
  if (!pgsql_is_fine(st->result)) {
    return pgsql_failed(c, st->result);
  }
  if (PQresultStatus(st->result) == PGRES_COMMAND_OK) {
    c->changes = strtoll(PQcmdTuples(st->result), NULL, 10);
  }
  return SQL_OK;
}

static int send(statement *st, sql_expect expect) {
  int code = SQL_OK;
  if (st->generation != st->c->generation) {
    settle_types(st);
    code = pgsql_send_prepare(st->c, st->name, st->sql, st->parameters, st->types, &st->generation);
  }
  return code == SQL_OK ? pgsql_send(st->c, st->name, st->parameters, st->values, expect) : code;
}

static int later(sql_statement *s, sql_expect expect) {
  statement *st = s->native;
  pgsql_connection *c = st->c;
  int code = c->sent || pgsql_is_within(c) ? SQL_OK : pgsql_restore(c);
  code = code == SQL_OK ? send(st, expect) : code;
  reset(s);
  return code;
}

/* A query outside of transactions is repeated if the connection was lost: it only reads. */
static int first_step(statement *st) {
  pgsql_connection *c = st->c;
  if (c->sent) {
    int code = send(st, SQL_ANY);
    return code == SQL_OK ? pgsql_settle(c, &st->result) : code;
  }
  int within = pgsql_is_within(c), code = within ? SQL_OK : pgsql_restore(c);
  code = code == SQL_OK ? run_prepared(st) : code;
  if (code != SQL_OK && !within && pgsql_is_lost(c) && (code = pgsql_restore(c)) == SQL_OK) {
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
  int code = pgsql_run(c->native, "SELECT (to_regclass('catalogue') IS NOT NULL)::int", &found);
  if (code == SQL_OK && found) {
    code = pgsql_run(c->native, "SELECT schema FROM catalogue", &found);
  }
  *version = found < INT32_MAX ? (int)found : INT32_MAX;
  return code;
}

const sql_driver sql_postgresql = {
    .open = open_server,
    .close = close_server,
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
