/* Statements over a database: what all databases of the catalogue have in common. A driver is a table of functions;
 * sqlite.c defines that of SQLite, postgresql.c that of PostgreSQL. Both run the same SQL: that of SQLite, as far as
 * the schema of PostgreSQL defines the functions that it lacks. Where they differ, the caller chooses
 * (database_either()). Parameters are numbered from ?1, and one may occur several times.
 *
 * A connection belongs to one thread at a time, and so do its statements. A text that is bound or read is borrowed: a
 * bound one must live until the statement is reset, one that is read lives until the statement steps again. */
#ifndef ORB_STORE_SQL_H
#define ORB_STORE_SQL_H

#include <stdint.h>

/* The result of a call. All but the first three are errors. */
enum sql_code {
  SQL_OK,
  SQL_ROW,  /* a step has a row */
  SQL_DONE, /* a step has no further row */
  SQL_ERROR,
  SQL_CONSTRAINT, /* a condition failed: of the schema, or of the caller */
  SQL_NOTFOUND,   /* only callers return it: there is no such row */
  SQL_LOST,       /* only callers return it: see object_lock_check() */
  SQL_NOMEM,
  SQL_FULL,
  SQL_IOERR,
  SQL_BUSY, /* another process has the database */
  SQL_READONLY,
  SQL_CANTOPEN,
  SQL_CORRUPT,
  SQL_NOTADB,
  SQL_SCHEMA,     /* of a newer program, or of an older one that runs */
  SQL_UNFINISHED, /* an incomplete copy of another catalogue, see store/move_mark.h */
  SQL_CODES
};
const char *sql_reason(int code); /* in words */

/* What must hold of a statement whose result is looked at later. */
typedef enum sql_expect {
  SQL_ANY,
  SQL_ONE_CHANGE, /* it changes one row; else SQL_CONSTRAINT */
  SQL_ZERO        /* its only row has the integer 0; else SQL_LOST */
} sql_expect;

typedef struct sql_connection {
  const struct sql_driver *driver;
  void *native;
} sql_connection;

typedef struct sql_statement {
  const struct sql_driver *driver;
  void *native;
} sql_statement;

/* What a connection may do: read; write, and create the database if there is none; write beside other nodes. */
enum { SQL_READS, SQL_WRITES, SQL_SHARES };
/* Advisory locks of PostgreSQL. The first is of the connection that writes, the next of migrations, then of
 * transactions of nodes, of housekeeping, of publishing and deleting objects, and of --gc and --check-data. */
enum { SQL_LOCK = 0x6f726d, SQL_LOCK_WRITES = SQL_LOCK + 2, SQL_LOCK_HOUSE, SQL_LOCK_OBJECTS, SQL_LOCK_MAINTAIN };

typedef struct sql_driver {
  /* writer: one of the above. The caller closes the connection, also if it could not be opened. */
  int (*open)(const char *where, int writer, sql_connection *out);
  void (*close)(sql_connection *c);
  const char *(*message)(const sql_connection *c);    /* of the last error */
  int (*out_of_memory)(const sql_connection *c);      /* whether that was the last error */
  int (*execute)(sql_connection *c, const char *sql); /* any number of statements, without parameters; logs errors */
  /* Begins a transaction that writes: with SQL_SHARES, after those of other nodes. It may be sent with the first
   * statement. */
  int (*begin)(sql_connection *c);
  int (*in_transaction)(const sql_connection *c);
  int (*version)(sql_connection *c, int *version); /* of the schema; 0: there is none */
  /* Of the connection that writes: keeps all other daemons out until hold(). SQL_BUSY: another one is connected. */
  int (*exclude)(sql_connection *c);
  /* Of the connection that writes, once its schema is up to date. */
  int (*hold)(sql_connection *c);
  int64_t (*changes)(const sql_connection *c); /* rows that the last INSERT, UPDATE or DELETE changed */

  int (*prepare)(sql_connection *c, const char *sql, sql_statement *out);
  void (*finish)(sql_statement *st); /* before the connection is closed */
  void (*clear)(sql_statement *st);  /* all parameters are NULL again; after reset */
  void (*reset)(sql_statement *st);
  void (*bind_text)(sql_statement *st, int parameter, const char *text);
  void (*bind_integer)(sql_statement *st, int parameter, int64_t value);
  int (*step)(sql_statement *st);
  /* Runs a statement whose result nobody waits for, and resets it. A driver may send it together with the next ones.
   * Then its error, or SQL_CONSTRAINT or SQL_LOST where it is not as expected, comes from the step(), execute() or
   * settle() that follows. What changes() returns after it is undefined. */
  int (*later)(sql_statement *st, sql_expect expect);
  int (*settle)(sql_connection *c); /* waits for such statements; SQL_OK, or the first error */
  /* Of the row, columns from 0. */
  int (*is_null)(sql_statement *st, int column);
  int64_t (*integer)(sql_statement *st, int column);
  const char *(*text)(sql_statement *st, int column); /* NULL for SQL NULL, and if out of memory */
  const void *(*bytes)(sql_statement *st, int column, int *size);
} sql_driver;

extern const sql_driver sql_sqlite; /* where: the path of its file */
/* Whether a statement of this process has met a damaged page, in any file. It stays so until the process ends. */
int sql_sqlite_is_damaged(void);
/* where: a URL, postgresql://…. One connection that writes at a time: SQL_BUSY if another process has one. */
extern const sql_driver sql_postgresql;
/* Whether the server failed to answer the last attempt to connect; the second function records that. */
int sql_postgresql_is_away(void);
void sql_postgresql_note(int is_away);
/* Whether another daemon has used the catalogue since this one opened it: only a restart helps then. */
int sql_postgresql_is_taken(void);
/* When the server last failed to answer, or a connection was found lost, in ms of the monotonic clock; 0: never. */
int64_t sql_postgresql_failed_at(void);

static inline void sql_bind_text(sql_statement *st, int parameter, const char *text) {
  st->driver->bind_text(st, parameter, text);
}
static inline void sql_bind_integer(sql_statement *st, int parameter, int64_t value) {
  st->driver->bind_integer(st, parameter, value);
}
static inline int sql_step(sql_statement *st) {
  return st->driver->step(st);
}
static inline int sql_later(sql_statement *st, sql_expect expect) {
  return st->driver->later(st, expect);
}
static inline void sql_reset(sql_statement *st) { /* NULL: nothing to reset */
  if (st) {
    st->driver->reset(st);
  }
}
static inline int sql_is_null(sql_statement *st, int column) {
  return st->driver->is_null(st, column);
}
static inline int64_t sql_integer(sql_statement *st, int column) {
  return st->driver->integer(st, column);
}
static inline int sql_int(sql_statement *st, int column) {
  return (int)st->driver->integer(st, column);
}
static inline const char *sql_text(sql_statement *st, int column) {
  return st->driver->text(st, column);
}
static inline const void *sql_bytes(sql_statement *st, int column, int *size) {
  return st->driver->bytes(st, column, size);
}

#endif
