/* The writer thread with group commit, and the pool of readers. */
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

#include "faults.h"
#include "log.h"
#include "orbmorph/context.h"
#include "store/catalogue.h"
#include "store/move_mark.h"
#include "store/object_lock.h"
#include "store/transactions.h"
#include "wake.h"

enum { BUSY_TRIES = 3 };

/* How long events and times of use wait for a write whose caller waits. Their own commit, with its fdatasync(), costs
 * more than all else that a small job writes. The end of such a job takes its events along. */
enum { GATHER_MS = 20 };
/* The same if several nodes share the catalogue: their transactions wait for each other. Events reach other nodes later
 * by up to this time. */
enum { GATHER_SHARED_MS = 100 };

/* A waiting write. catalogue_write() keeps it on its caller's stack. */
typedef struct pending {
  struct pending *next;
  write_fn fn;
  void *arg;
  int later; /* nobody waits for it: the writer frees it, and its argument by `release` */
  void (*release)(void *arg);
  int64_t number; /* see object_lock_check() */
  int done, code;
} pending;

struct catalogue {
  pthread_mutex_t lock;
  pthread_cond_t wake, committed, reader_free;
  pending *first, **last, *newest;
  int urgent; /* of the waiting writes, all but those of catalogue_write_gathered() */
  int stopping, started;
  int shared;  /* other nodes use it as well */
  int commits; /* of the writer: the running batch has sent its commit */
  pthread_t thread;
  database writer;
  database readers[DATABASE_READERS];
  int busy[DATABASE_READERS];
  char path[PATH_MAX];
};

static store_result result_of(int code) {
  switch (code) {
    case SQL_OK:
      return STORE_OK;
    case SQL_CONSTRAINT:
      return STORE_CONFLICT;
    case SQL_NOTFOUND:
      return STORE_NOT_FOUND;
    case SQL_FULL:
      return STORE_FULL;
    case SQL_LOST:
      return STORE_LOST;
    default:
      return STORE_ERROR;
  }
}

/* One write of a batch. */
static int run_one(database *db, pending *p) {
  p->code = object_lock_check(db, p->number);
  p->code = p->code == SQL_OK ? p->fn(db, p->arg) : p->code;
  return p->code;
}

static int commit(catalogue *cat) {
  FAULT_POINT("before-commit");
  cat->commits = 1;
  return database_execute(&cat->writer, "COMMIT");
}

/* Runs a batch in one transaction without savepoints: a single write, or writes to a database on another machine, where
 * savepoints would cost as many requests as a small write itself while other nodes wait. If one of several writes
 * fails, nothing is written, and *again is 1. */
static int run_plain(catalogue *cat, pending *batch, int *again) {
  database *db = &cat->writer;
  int code = database_begin(db), failed = SQL_OK;
  for (pending *p = batch; p && code == SQL_OK && failed == SQL_OK; p = p->next) {
    failed = run_one(db, p);
  }
  failed = code == SQL_OK && failed == SQL_OK ? database_settle(db) : failed;
  if (failed != SQL_OK) {
    batch->code = failed; /* if there are others, they run again */
    database_settle(db);
    code = sql_in_transaction(db) ? database_execute(db, "ROLLBACK") : failed;
    *again = code == SQL_OK && batch->next != NULL;
    return code;
  }
  return code == SQL_OK ? commit(cat) : code;
}

/* The same with savepoints: a write that fails is rolled back alone. */
static int run_careful(catalogue *cat, pending *batch) {
  database *db = &cat->writer;
  int code = database_begin(db);
  for (pending *p = batch; p && code == SQL_OK; p = p->next) {
    if (database_execute(db, "SAVEPOINT one") != SQL_OK) {
      code = SQL_IOERR;
      break;
    }
    if (run_one(db, p) == SQL_OK) {
      p->code = database_settle(db);
    }
    if (p->code != SQL_OK) {
      database_settle(db);
      database_execute(db, "ROLLBACK TO one");
    }
    /* A full disk or an input/output error may have rolled back everything already. */
    if (!sql_in_transaction(db)) {
      code = p->code;
    } else if (database_execute(db, "RELEASE one") != SQL_OK) {
      code = SQL_IOERR;
    }
  }
  return code == SQL_OK ? commit(cat) : code;
}

/* Runs a batch. A write that fails changes nothing, and the others are written; if the commit fails, all writes fail.
 */
static int run_batch(catalogue *cat, pending *batch) {
  database *db = &cat->writer;
  FAULT_POINT("before-begin");
  cat->commits = 0;
  /* A previous transaction may still be open if its rollback failed. */
  int code = sql_in_transaction(db) ? database_execute(db, "ROLLBACK") : SQL_OK;
  int careful = !cat->shared && batch->next;
  if (code == SQL_OK && !careful) {
    code = run_plain(cat, batch, &careful);
  }
  if (code == SQL_OK && careful) {
    code = run_careful(cat, batch);
  }
  FAULT_POINT("after-commit");
  if (code != SQL_OK) {
    if (sql_in_transaction(db)) {
      database_execute(db, "ROLLBACK");
    }
    for (pending *p = batch; p; p = p->next) {
      p->code = code;
    }
  }
  return code;
}

/* Under the lock: waits for the next batch. Returns NULL if the writer stops and nothing is left. */
static pending *wait_for_batch(catalogue *cat) {
  while (!cat->first && !cat->stopping) {
    pthread_cond_wait(&cat->wake, &cat->lock);
  }
  const int64_t most = cat->shared ? GATHER_SHARED_MS : GATHER_MS, until = orb_clock_ms() + most;
  for (int64_t left = most; cat->first && !cat->urgent && !cat->stopping && left > 0;) {
    wake_wait_ms(&cat->wake, &cat->lock, left);
    left = until - orb_clock_ms();
  }
  return cat->first;
}

/* Whether a batch that wrote nothing runs again: one that waited too long for another node or conflicted with it, or
 * one whose connection was lost, which shows only when it is used. */
static int may_repeat(const catalogue *cat, int code, int tries) {
  return (cat->shared && code == SQL_BUSY && tries < BUSY_TRIES) ||
         (database_is_url(cat->path) && code == SQL_IOERR && !cat->commits && tries == 1);
}

static void *writer_main(void *argument) {
  catalogue *cat = argument;
  pthread_mutex_lock(&cat->lock);
  for (pending *batch; (batch = wait_for_batch(cat));) {
    cat->urgent = 0;
    cat->first = NULL;
    cat->last = &cat->first;
    cat->newest = NULL;
    pthread_mutex_unlock(&cat->lock);
    int code = run_batch(cat, batch);
    for (int tries = 1; may_repeat(cat, code, tries); tries++) {
      code = run_batch(cat, batch);
    }
    if (code != SQL_OK && database_is_url(cat->path) && !sql_postgresql_is_away()) {
      log_error("catalogue: a transaction failed: %s", cat->writer.connection.driver->message(&cat->writer.connection));
    }
    pthread_mutex_lock(&cat->lock);
    for (pending *p = batch, *next; p; p = next) {
      next = p->next;
      if (p->later) {
        p->release(p->arg);
        free(p);
      } else {
        p->done = 1; /* its thread may now return, which ends the life of p */
      }
    }
    pthread_cond_broadcast(&cat->committed);
  }
  pthread_mutex_unlock(&cat->lock);
  return NULL;
}

static void enqueue(catalogue *cat, pending *p, int urgent) {
  if (urgent || !cat->first) {
    pthread_cond_signal(&cat->wake);
  }
  *cat->last = p;
  cat->last = &p->next;
  cat->newest = p;
  cat->urgent |= urgent;
}

static store_result write_and_wait(catalogue *cat, write_fn fn, void *arg, int64_t number) {
  pending p = {.fn = fn, .arg = arg, .number = number};
  pthread_mutex_lock(&cat->lock);
  enqueue(cat, &p, 1);
  while (!p.done) {
    pthread_cond_wait(&cat->committed, &cat->lock);
  }
  pthread_mutex_unlock(&cat->lock);
  return result_of(p.code);
}

store_result catalogue_write(catalogue *cat, write_fn fn, void *arg) {
  return write_and_wait(cat, fn, arg, 0);
}

store_result catalogue_write_held(catalogue *cat, write_fn fn, void *arg) {
  return write_and_wait(cat, fn, arg, object_lock_number());
}

static void write_later(catalogue *cat, write_fn fn, void *arg, int urgent) {
  pending *p = calloc(1, sizeof *p);
  if (!p) {
    free(arg);
    return;
  }
  *p = (pending){.fn = fn, .arg = arg, .later = 1, .release = free};
  pthread_mutex_lock(&cat->lock);
  enqueue(cat, p, urgent);
  pthread_mutex_unlock(&cat->lock);
}

void catalogue_write_later(catalogue *cat, write_fn fn, void *arg) {
  write_later(cat, fn, arg, 1);
}

void catalogue_write_gathered(catalogue *cat, write_fn fn, void *arg) {
  write_later(cat, fn, arg, 0);
}

void catalogue_write_joined(catalogue *cat, write_fn fn, void *arg, int (*join)(void *waiting, void *arg),
                            void (*release)(void *arg)) {
  pthread_mutex_lock(&cat->lock);
  pending *newest = cat->newest && cat->newest->fn == fn ? cat->newest : NULL;
  const int joined = newest && join(newest->arg, arg);
  pending *p = joined ? NULL : calloc(1, sizeof *p);
  if (p) {
    *p = (pending){.fn = fn, .arg = arg, .later = 1, .release = release};
    enqueue(cat, p, 0);
  }
  pthread_mutex_unlock(&cat->lock);
  if (!joined && !p) {
    release(arg);
  }
}

database *catalogue_reader(catalogue *cat) {
  pthread_mutex_lock(&cat->lock);
  for (;;) {
    for (int i = 0; i < DATABASE_READERS; i++) {
      if (!cat->busy[i]) {
        cat->busy[i] = 1;
        pthread_mutex_unlock(&cat->lock);
        return &cat->readers[i];
      }
    }
    pthread_cond_wait(&cat->reader_free, &cat->lock);
  }
}

void catalogue_reader_done(catalogue *cat, database *db) {
  pthread_mutex_lock(&cat->lock);
  cat->busy[db - cat->readers] = 0;
  pthread_cond_signal(&cat->reader_free);
  pthread_mutex_unlock(&cat->lock);
}

/* Whether the catalogue is complete, and not one that a move has filled in part. */
static int check_whole(database *db) {
  char mark[MOVE_MARK];
  int code = move_mark_read(db, mark);
  if (code == SQL_OK && *mark) {
    log_error(
        "orbmorphd migrate has filled this catalogue in part: run it again until it ends, or name another catalogue");
    return SQL_UNFINISHED;
  }
  return code;
}

static int open_all(catalogue *cat, const char *path) {
  int code = database_open(path, cat->shared ? SQL_SHARES : SQL_WRITES, &cat->writer);
  code = code == SQL_OK ? check_whole(&cat->writer) : code;
  if (code == SQL_OK) {
    code = database_migrate(&cat->writer);
  }
  for (int i = 0; i < DATABASE_READERS && code == SQL_OK; i++) {
    code = database_open(path, 0, &cat->readers[i]);
  }
  return code;
}

const char *catalogue_path(const catalogue *cat) {
  return cat->path;
}

int catalogue_is_away(const catalogue *cat) {
  return database_is_url(cat->path) && sql_postgresql_is_away();
}

int catalogue_is_damaged(const catalogue *cat) {
  return !database_is_url(cat->path) && sql_sqlite_is_damaged();
}

int catalogue_is_taken(const catalogue *cat) {
  return database_is_url(cat->path) && sql_postgresql_is_taken();
}

int catalogue_was_away(const catalogue *cat, int64_t since) {
  return database_is_url(cat->path) && sql_postgresql_failed_at() >= since;
}

int catalogue_is_shared(const catalogue *cat) {
  return cat->shared;
}

store_result catalogue_open(const char *where, catalogue **out) {
  return catalogue_open_shared(where, 0, out);
}

store_result catalogue_opened(int code, int is_url) {
  const int refused = code == SQL_READONLY || code == SQL_NOTADB;
  return code == SQL_OK                                                        ? STORE_OK
         : code == SQL_FULL                                                    ? STORE_FULL
         : code == SQL_UNFINISHED || code == SQL_SCHEMA || (is_url && refused) ? STORE_UNFIT
                                                                               : STORE_ERROR;
}

store_result catalogue_open_shared(const char *where, int shared, catalogue **out) {
  catalogue *cat = calloc(1, sizeof *cat);
  if (!cat) {
    return STORE_ERROR;
  }
  cat->last = &cat->first;
  cat->shared = shared;
  pthread_mutex_init(&cat->lock, NULL);
  wake_init(&cat->wake);
  pthread_cond_init(&cat->committed, NULL);
  pthread_cond_init(&cat->reader_free, NULL);
  snprintf(cat->path, sizeof cat->path, database_is_url(where) ? "%s" : "%s/catalogue.sqlite", where);
  int code = open_all(cat, cat->path);
  if (code == SQL_OK && pthread_create(&cat->thread, NULL, writer_main, cat) == 0) {
    cat->started = 1;
    *out = cat;
    return STORE_OK;
  }
  if (!database_is_url(where)) { /* a URL may hold a password; the driver has said why */
    log_error("the catalogue %s cannot be opened: %s", cat->path, sql_reason(code));
  }
  catalogue_close(cat);
  return code == SQL_OK ? STORE_ERROR : catalogue_opened(code, database_is_url(where)); /* its thread has not started */
}

void catalogue_close(catalogue *cat) {
  if (!cat) {
    return;
  }
  if (cat->started) {
    pthread_mutex_lock(&cat->lock);
    cat->stopping = 1;
    pthread_cond_signal(&cat->wake);
    pthread_mutex_unlock(&cat->lock);
    pthread_join(cat->thread, NULL);
  }
  for (int i = 0; i < DATABASE_READERS; i++) {
    database_close(&cat->readers[i]);
  }
  database_close(&cat->writer);
  free(cat);
}
