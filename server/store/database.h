/* The inside of the catalogue: connections with prepared statements, the writer's queue, the schema. */
#ifndef ORB_STORE_DATABASE_H
#define ORB_STORE_DATABASE_H

#include <pthread.h>

#include "store/catalogue.h"

enum { DATABASE_STATEMENTS = 64, DATABASE_READERS = 6 };

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

typedef int (*write_fn)(database *db, void *arg); /* returns an SQLite code; SQLITE_CONSTRAINT: a condition failed */

/* Runs fn in the next transaction and waits for its commit. */
store_result catalogue_write(catalogue *cat, write_fn fn, void *arg);
/* The same without waiting; frees arg with free(). */
void catalogue_write_later(catalogue *cat, write_fn fn, void *arg);

database *catalogue_reader(catalogue *cat); /* waits until one is free */
void catalogue_reader_done(catalogue *cat, database *db);

#endif
