/* One connection to PostgreSQL: opens it, locks it for writing, and connects again after a loss. For postgresql.c.
 *
 * The connection that writes holds an advisory lock, one for each schema, so that one daemon alone works on a
 * catalogue, as the lock of the data folder ensures for SQLite. A lost connection loses the lock. The daemon gets the
 * lock back only if no other daemon has held it meanwhile, which the number `holder` of the catalogue shows. */
#ifndef ORB_STORE_POSTGRESQL_CONNECTION_H
#define ORB_STORE_POSTGRESQL_CONNECTION_H

#include <libpq-fe.h>
#include <stdint.h>

enum { PGSQL_SENT = 64 };

typedef struct pgsql_connection {
  PGconn *server;
  int writer, out_of_memory;
  int excludes;   /* whether it keeps other nodes out */
  int generation; /* counts connections: statements are prepared again on each */
  int statements; /* counts them, for their names */
  int64_t changes, holder;
  int broken;      /* unusable, whatever its socket says */
  int waits_on;    /* the generation that the wait for other nodes is prepared on */
  int sent, begun; /* statements in flight (postgresql_pipeline.h); whether BEGIN is one of them */
  struct {
    int expect;    /* sql_expect */
    int *prepares; /* a PREPARE: gets the generation of the connection, or 0 if it fails */
  } in_flight[PGSQL_SENT];
  char message[400]; /* of the last error */
} pgsql_connection;

/* The functions return codes of sql.h. */

/* writer: see sql_driver.open. *out: the caller closes it, also after a failure; NULL if out of memory. */
int pgsql_open(const char *where, int writer, pgsql_connection **out);
void pgsql_close(pgsql_connection *c);
/* As sql_driver.exclude and sql_driver.hold. */
int pgsql_exclude(pgsql_connection *c);
int pgsql_hold(pgsql_connection *c);

/* Runs one or several statements without parameters. *value: the integer in the first row of the last one; NULL: the
 * caller does not want it. */
int pgsql_run(pgsql_connection *c, const char *sql, int64_t *value);
int pgsql_is_fine(const PGresult *result);
/* Notes the error of a result (NULL: of the connection) and returns its code. */
int pgsql_failed(pgsql_connection *c, const PGresult *result);

int pgsql_is_lost(const pgsql_connection *c);
int pgsql_is_within(const pgsql_connection *c); /* a transaction */
/* Connects again if the connection was lost. Do not call it within a transaction: the new connection is outside of it.
 */
int pgsql_restore(pgsql_connection *c);

#endif
