/* The inside of the catalogue: connections with prepared statements, and the schema. */
#ifndef ORB_STORE_DATABASE_H
#define ORB_STORE_DATABASE_H

#include "store/sql.h"

enum { DATABASE_STATEMENTS = 128, DATABASE_READERS = 6 };

/* A connection, for one thread at a time. Statements are cached by the address of their text. */
typedef struct database {
  sql_connection connection;
  struct {
    const char *sql;
    sql_statement statement;
  } cached[DATABASE_STATEMENTS];
} database;

/* where: the path of an SQLite file, or the URL of a database in PostgreSQL. */
int database_open(const char *where, int writer, database *out);
void database_close(database *db);
/* The statement, reset and without bindings; NULL on error. */
sql_statement *database_statement(database *db, const char *sql);
/* Steps once, for statements without result rows. SQL_OK or the error. */
int database_run(database *db, sql_statement *statement);
/* The same for a statement whose result nobody waits for (sql_driver.later). */
int database_run_later(database *db, sql_statement *statement, sql_expect expect);
int database_settle(database *db); /* waits for them */
int database_execute(database *db, const char *sql);
int database_begin(database *db); /* a transaction that writes */
/* Whether it is in PostgreSQL. */
int database_is_url(const char *where);
/* The SQL for this database, where the two do not speak the same. */
static inline const char *database_either(const database *db, const char *sqlite, const char *postgresql) {
  return db->connection.driver == &sql_postgresql ? postgresql : sqlite;
}
/* Brings the schema up to date. SQL_OK, or SQL_SCHEMA if the schema is newer than this program. */
int database_migrate(database *db);

static inline int64_t sql_changes(const database *db) {
  return db->connection.driver->changes(&db->connection);
}
static inline int sql_in_transaction(const database *db) {
  return db->connection.driver->in_transaction(&db->connection);
}
static inline int sql_out_of_memory(const database *db) {
  return db->connection.driver->out_of_memory(&db->connection);
}

#endif
