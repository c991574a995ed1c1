/* Transactions of the catalogue, for the files that define its rows: one writer thread, several readers. */
#ifndef ORB_STORE_TRANSACTIONS_H
#define ORB_STORE_TRANSACTIONS_H

#include "store/database.h"
#include "store/objects.h"

struct catalogue;

typedef int (*write_fn)(database *db, void *arg); /* returns an SQL code; SQL_CONSTRAINT: a condition failed */

/* Runs fn in the next transaction and waits for its commit. */
store_result catalogue_write(struct catalogue *cat, write_fn fn, void *arg);

/* The same, for a row that names objects which this thread has published. STORE_LOST: it does not hold the store any
 * more (objects_hold()), or did not all the time; nothing is written. */
store_result catalogue_write_held(struct catalogue *cat, write_fn fn, void *arg);

/* The same as catalogue_write() without waiting; frees arg with free(). */
void catalogue_write_later(struct catalogue *cat, write_fn fn, void *arg);

/* The same as catalogue_write_later(), but the write may wait up to 20 ms, or 100 ms where other nodes share the
 * catalogue, to be committed with others. All writes keep their order. */
void catalogue_write_gathered(struct catalogue *cat, write_fn fn, void *arg);

/* The same, and if the last waiting write has this fn, join(its argument, arg) may take arg over instead: it returns 1,
 * or 0. What it returns, arg belongs to this function. */
void catalogue_write_joined(struct catalogue *cat, write_fn fn, void *arg, int (*join)(void *waiting, void *arg),
                            void (*release)(void *arg));

/* What the code of an attempt to open a database means to callers of catalogue_open(). */
store_result catalogue_opened(int code, int is_url);

const char *catalogue_path(const struct catalogue *cat);

database *catalogue_reader(struct catalogue *cat); /* waits until one is free */

void catalogue_reader_done(struct catalogue *cat, database *db);

#endif
