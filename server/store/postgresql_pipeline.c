#include "store/postgresql_pipeline.h"

#include <stdio.h>
#include <stdlib.h>

static int note(pgsql_connection *c, int sent, sql_expect expect, int *prepares) {
  if (!sent) {
    return pgsql_failed(c, NULL);
  }
  c->in_flight[c->sent].expect = (int)expect;
  c->in_flight[c->sent++].prepares = prepares;
  return SQL_OK;
}

/* Makes room for one more. */
static int enter(pgsql_connection *c) {
  int code = c->sent == PGSQL_SENT ? pgsql_settle(c, NULL) : SQL_OK;
  if (code == SQL_OK && PQpipelineStatus(c->server) == PQ_PIPELINE_OFF && !PQenterPipelineMode(c->server)) {
    code = pgsql_failed(c, NULL);
  }
  return code;
}

int pgsql_send_begin(pgsql_connection *c, int waits) {
  static const char name[] = "writes";
  char sql[96];
  int code = enter(c);
  code = code == SQL_OK ? note(c, PQsendQueryParams(c->server, "BEGIN", 0, NULL, NULL, NULL, NULL, 0), SQL_ANY, NULL)
                        : code;
  c->begun = code == SQL_OK;
  if (code == SQL_OK && waits && c->waits_on != c->generation) {
    snprintf(sql, sizeof sql, "SELECT pg_advisory_xact_lock(%d, hashtext(current_schema()))", SQL_LOCK_WRITES);
    code = pgsql_send_prepare(c, name, sql, 0, NULL, &c->waits_on);
  }
  return code == SQL_OK && waits ? pgsql_send(c, name, 0, NULL, SQL_ANY) : code;
}

int pgsql_send_prepare(pgsql_connection *c, const char *name, const char *sql, int parameters, const Oid *types,
                       int *prepared) {
  int code = enter(c);
  code = code == SQL_OK ? note(c, PQsendPrepare(c->server, name, sql, parameters, types), SQL_ANY, prepared) : code;
  *prepared = code == SQL_OK ? c->generation : 0;
  return code;
}

void pgsql_forget(pgsql_connection *c, const int *prepared) {
  for (int i = 0; i < c->sent; i++) {
    if (c->in_flight[i].prepares == prepared) {
      c->in_flight[i].prepares = NULL;
    }
  }
}

int pgsql_send(pgsql_connection *c, const char *name, int parameters, const char *const *values, sql_expect expect) {
  int code = enter(c);
  return code == SQL_OK ? note(c, PQsendQueryPrepared(c->server, name, parameters, values, NULL, NULL, 0), expect, NULL)
                        : code;
}

static int judge(pgsql_connection *c, PGresult *result, sql_expect expect) {
  if (!pgsql_is_fine(result)) {
    return pgsql_failed(c, result);
  }
  if (PQresultStatus(result) == PGRES_COMMAND_OK) {
    c->changes = strtoll(PQcmdTuples(result), NULL, 10);
  }
  const int zero = PQntuples(result) == 1 && strtoll(PQgetvalue(result, 0, 0), NULL, 10) == 0;
  return expect == SQL_ONE_CHANGE && c->changes != 1 ? SQL_CONSTRAINT : expect == SQL_ZERO && !zero ? SQL_LOST : SQL_OK;
}

/* The result of one statement, whose end is marked by NULL: a server that ends may send several errors. NULL: the
 * connection is lost. */
static PGresult *take(const pgsql_connection *c) {
  PGresult *result = PQgetResult(c->server);
  for (PGresult *more = result; more && !pgsql_is_lost(c);) {
    more = PQgetResult(c->server);
    PQclear(more);
  }
  return result;
}

/* Takes what is left until the server has come to the end of the pipeline. If it does not, the connection is unusable.
 */
static void leave(pgsql_connection *c) {
  enum { MOST = 2 * PGSQL_SENT };
  int over = 0;
  for (int i = 0; i < MOST && !over && !pgsql_is_lost(c); i++) {
    PGresult *result = PQgetResult(c->server);
    over = result && PQresultStatus(result) == PGRES_PIPELINE_SYNC;
    PQclear(result);
  }
  c->broken |= !over || !PQexitPipelineMode(c->server);
}

int pgsql_settle(pgsql_connection *c, PGresult **last) {
  if (c->sent == 0) {
    return SQL_OK;
  }
  int code = SQL_OK;
  if (!PQpipelineSync(c->server)) { /* the server sends nothing then, and results would never come */
    code = pgsql_failed(c, NULL);
    c->broken = 1;
  }
  for (int i = 0; i < c->sent; i++) {
    PGresult *result = pgsql_is_lost(c) ? NULL : take(c);
    const int failed = !result || !pgsql_is_fine(result);
    if (code == SQL_OK) {
      code = result ? judge(c, result, (sql_expect)c->in_flight[i].expect) : pgsql_failed(c, NULL);
    }
    if (c->in_flight[i].prepares && failed) {
      *c->in_flight[i].prepares = 0;
    }
    if (last && i == c->sent - 1 && code == SQL_OK) {
      *last = result;
    } else {
      PQclear(result);
    }
  }
  c->sent = c->begun = 0;
  leave(c);
  return code;
}
