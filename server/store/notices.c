#include "store/notices.h"

#include <libpq-fe.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "log.h"
#include "store/sql.h"

struct notices {
  PGconn *server;
  int connected, house;
  char url[];
};

notices *notices_open(const char *url) {
  size_t size = strlen(url) + 1;
  notices *n = calloc(1, sizeof *n + size);
  if (n) {
    memcpy(n->url, url, size);
  }
  return n;
}

void notices_close(notices *n) {
  if (n) {
    PQfinish(n->server);
    free(n);
  }
}

static int is_fine(const PGresult *result) {
  ExecStatusType status = PQresultStatus(result);
  return status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK;
}

/* Runs a statement; *value: the first column of its first row as an integer. */
static int run(notices *n, const char *sql, const char *const *values, int count, int *value) {
  PGresult *result = PQexecParams(n->server, sql, count, NULL, values, NULL, NULL, 0);
  int fine = is_fine(result);
  if (fine && value) {
    *value = PQntuples(result) > 0 && strcmp(PQgetvalue(result, 0, 0), "t") == 0;
  }
  if (!fine) {
    log_warn("the node's connection to the catalogue: %.300s", PQerrorMessage(n->server));
  }
  PQclear(result);
  n->connected = PQstatus(n->server) == CONNECTION_OK;
  n->house = n->house && n->connected;
  return fine;
}

/* The name of the channel depends on the schema; LISTEN takes no parameter. */
static int listen_to(notices *n) {
  PGresult *result = PQexec(n->server, "SELECT 'LISTEN orbmorph_' || md5(current_schema())");
  int fine = is_fine(result) && PQntuples(result) == 1 && run(n, PQgetvalue(result, 0, 0), NULL, 0, NULL);
  PQclear(result);
  return fine;
}

int notices_connect(notices *n, int *fresh) {
  static const char *const names[] = {"connect_timeout", "fallback_application_name", "tcp_user_timeout", "dbname",
                                      NULL};
  const char *const values[] = {"5", "orbmorphd", "10000", n->url, NULL};
  *fresh = 0;
  if (n->connected && PQstatus(n->server) == CONNECTION_OK) {
    return 1;
  }
  PQfinish(n->server);
  n->house = 0;
  n->server = PQconnectdbParams(names, values, 1);
  n->connected = PQstatus(n->server) == CONNECTION_OK && run(n, "SET client_min_messages=warning", NULL, 0, NULL) &&
                 run(n, "SET statement_timeout='20s'", NULL, 0, NULL) && listen_to(n);
  sql_postgresql_note(!n->connected);
  *fresh = n->connected;
  return n->connected;
}

void notices_wait(notices *n, int ms, void (*each)(void *user, const char *text), void *user) {
  struct pollfd wait = {.fd = n->connected ? PQsocket(n->server) : -1, .events = POLLIN};
  poll(&wait, 1, ms);
  if (!n->connected) {
    return;
  }
  n->connected = PQconsumeInput(n->server) && PQstatus(n->server) == CONNECTION_OK;
  n->house = n->house && n->connected;
  for (PGnotify *one; (one = PQnotifies(n->server));) {
    each(user, one->extra);
    PQfreemem(one);
  }
}

int notices_renew(notices *n, const char *node, int workers, int64_t lease_ms) {
  char count[24], lease[24];
  const char *const values[] = {node, count, lease};
  snprintf(count, sizeof count, "%d", workers);
  snprintf(lease, sizeof lease, "%lld", (long long)lease_ms);
  return run(n,
             "INSERT INTO node(name, workers, until) VALUES($1, $2::bigint, clock_ms()+$3::bigint)"
             " ON CONFLICT(name) DO UPDATE SET workers=excluded.workers, until=excluded.until",
             values, 3, NULL);
}

void notices_leave(notices *n, const char *node) {
  if (n->connected) {
    run(n, "DELETE FROM node WHERE name=$1", &node, 1, NULL);
  }
}

int notices_does_housekeeping(notices *n) {
  char sql[96];
  snprintf(sql, sizeof sql, "SELECT pg_try_advisory_lock(%d, hashtext(current_schema()))", SQL_LOCK_HOUSE);
  if (n->connected && !n->house) {
    run(n, sql, NULL, 0, &n->house);
  }
  return n->house;
}
