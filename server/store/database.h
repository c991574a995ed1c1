/* The inside of the catalogue: connections with prepared statements, and the schema. */
#ifndef ORB_STORE_DATABASE_H
#define ORB_STORE_DATABASE_H

#include <sqlite3.h>

enum { DATABASE_STATEMENTS = 96, DATABASE_READERS = 6 };

/* A connection, for one thread at a time. Statements are cached by the address of their text. */
typedef struct database {
  sqlite3 *handle;
  struct {
    const char *sql;
    sqlite3_stmt *statement;
  } cached[DATABASE_STATEMENTS];
} database;

int database_open(const char *path, int writer, database *out);
void database_close(database *db);
/* The statement, reset and without bindings; NULL on error. */
sqlite3_stmt *database_statement(database *db, const char *sql);
/* Steps once, for statements without result rows. SQLITE_OK or the error. */
int database_run(database *db, sqlite3_stmt *statement);
int database_execute(database *db, const char *sql);
/* Brings the schema up to date. SQLITE_OK, or SQLITE_SCHEMA if the schema is newer than this program. */
int database_migrate(database *db);

#endif
