/* Statements that are sent together, in libpq's pipeline mode: one round trip for many. For postgresql.c.
 *
 * Others wait for the transaction of a node, and each round trip makes them wait longer and costs both sides as much
 * time as a small statement. Between the first statement that is sent and pgsql_settle(), the connection is in pipeline
 * mode, in which PQexec() and the like do not work. */
#ifndef ORB_STORE_POSTGRESQL_PIPELINE_H
#define ORB_STORE_POSTGRESQL_PIPELINE_H

#include "store/postgresql_connection.h"
#include "store/sql.h"

/* Sends BEGIN, and the wait for the transactions of other nodes if `waits`. */
int pgsql_send_begin(pgsql_connection *c, int waits);
/* *prepared: set to the generation of the connection; 0 again if it turns out to fail. */
int pgsql_send_prepare(pgsql_connection *c, const char *name, const char *sql, int parameters, const Oid *types,
                       int *prepared);
/* The statement that *prepared belongs to ends. */
void pgsql_forget(pgsql_connection *c, const int *prepared);
int pgsql_send(pgsql_connection *c, const char *name, int parameters, const char *const *values, sql_expect expect);
/* Waits for all that was sent: SQL_OK, or the first error, after which the server has run none of those that follow.
 * *last: the result of the last one, which the caller clears; NULL: the caller does not want it. */
int pgsql_settle(pgsql_connection *c, PGresult **last);

#endif
