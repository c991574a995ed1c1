#include "store/object_lock.h"

#include <pthread.h>
#include <sodium.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "orbmorph/context.h"

struct object_lock {
  pthread_mutex_t lock;
  database db;
  int sharing; /* how many threads share; the first takes the lock of the database, the last gives it back */
  int shared;  /* the database gave the lock to them */
  int64_t number;
  char name[33]; /* of its announcements */
  int announced;
  int64_t kept_until; /* by orb_clock_ms(): an announcement stands that long at least */
};

static _Thread_local int64_t number_of_thread;

object_lock *object_lock_open(const char *url) {
  object_lock *l = calloc(1, sizeof *l);
  if (!l) {
    return NULL;
  }
  unsigned char random[16];
  randombytes_buf(random, sizeof random);
  sodium_bin2hex(l->name, sizeof l->name, random, sizeof random);
  pthread_mutex_init(&l->lock, NULL);
  if (database_open(url, SQL_READS, &l->db) != SQL_OK) {
    object_lock_close(l);
    return NULL;
  }
  return l;
}

void object_lock_close(object_lock *l) {
  if (l) {
    database_close(&l->db);
    pthread_mutex_destroy(&l->lock);
    free(l);
  }
}

static int run(object_lock *l, const char *sql) {
  return database_execute(&l->db, sql) == SQL_OK;
}

/* All locks of the connection are this one and its number. It may be a new connection, which has none. */
static void let_all_go(object_lock *l) {
  database_settle(&l->db);
  sql_statement *st = database_statement(&l->db, "SELECT pg_advisory_unlock_all()");
  if (st) {
    sql_step(st);
    sql_reset(st);
  }
}

/* A connection that was made again has no locks. */
static int holds_any(object_lock *l) {
  sql_statement *st = database_statement(
      &l->db, "SELECT count(*) FROM pg_locks WHERE locktype='advisory' AND pid=pg_backend_pid() AND granted");
  int holds = st && sql_step(st) == SQL_ROW && sql_integer(st, 0) > 0;
  sql_reset(st);
  return holds;
}

/* Waits for the deletions that nodes announced before they lost the lock. An announcement stands through its last
 * millisecond. */
static int wait_for_deletions(object_lock *l) {
  enum { LOOK_MS = 500 };
  int code = SQL_ROW;
  for (int64_t left = 1; left > 0 && code == SQL_ROW;) {
    sql_statement *st =
        database_statement(&l->db, "SELECT coalesce(max(until)+1-clock_ms(), 0) FROM deletion WHERE until>=clock_ms()");
    code = st ? sql_step(st) : SQL_ERROR;
    left = code == SQL_ROW ? sql_integer(st, 0) : 0;
    sql_reset(st);
    if (left > 0) {
      const int64_t ms = left < LOOK_MS ? left : LOOK_MS;
      nanosleep(&(struct timespec){0, (long)ms * 1000000}, NULL);
    }
  }
  return code == SQL_ROW ? SQL_OK : code == SQL_DONE ? SQL_ERROR : code;
}

/* Takes the lock and the number, in one round trip with the first question about deletions. */
static int take_shared(object_lock *l) {
  sql_statement *st = database_statement(&l->db, "SELECT pg_advisory_lock_shared(?1::int, hashtext(current_schema()))");
  if (st) {
    sql_bind_integer(st, 1, SQL_LOCK_OBJECTS);
  }
  int code = database_run_later(&l->db, st, SQL_ANY);
  st = code == SQL_OK ? database_statement(&l->db, "SELECT pg_advisory_lock(?1)") : NULL;
  if (st) {
    sql_bind_integer(st, 1, l->number);
    code = database_run_later(&l->db, st, SQL_ANY);
  }
  return code == SQL_OK && st ? wait_for_deletions(l) : code == SQL_OK ? SQL_ERROR : code;
}

/* Each time that sharing begins, it gets a new number, also if it does not get the lock: then nobody holds the number.
 */
static int begin_sharing(object_lock *l) {
  uint64_t random;
  randombytes_buf(&random, sizeof random);
  l->number = (int64_t)(random >> 1) | 1;
  int code = take_shared(l);
  if (code == SQL_IOERR) { /* the connection was lost since its last use; it is made again */
    code = take_shared(l);
  }
  if (code != SQL_OK) {
    let_all_go(l);
  }
  return code == SQL_OK;
}

int object_lock_share(object_lock *l) {
  pthread_mutex_lock(&l->lock);
  l->shared = l->sharing++ > 0 && l->shared && holds_any(l);
  l->shared = l->shared || begin_sharing(l);
  number_of_thread = l->number;
  int shared = l->shared;
  pthread_mutex_unlock(&l->lock);
  return shared;
}

void object_lock_unshare(object_lock *l) {
  pthread_mutex_lock(&l->lock);
  number_of_thread = 0;
  if (--l->sharing == 0 && l->shared) {
    let_all_go(l);
  }
  pthread_mutex_unlock(&l->lock);
}

int64_t object_lock_number(void) {
  return number_of_thread;
}

/* The number can be taken here only if the connection that held it is gone. */
int object_lock_check(database *db, int64_t number) {
  sql_statement *st = number ? database_statement(db, "SELECT pg_try_advisory_xact_lock(?1)::int") : NULL;
  if (st) {
    sql_bind_integer(st, 1, number);
  }
  return number ? database_run_later(db, st, SQL_ZERO) : SQL_OK;
}

/* The second lock is that of transactions (catalogue.c): a transaction that checked its lock before this one was free
 * ends first. */
int object_lock_exclude(object_lock *l) {
  char sql[192];
  snprintf(sql, sizeof sql,
           "SELECT pg_advisory_lock(%d, hashtext(current_schema()));"
           "SELECT pg_advisory_xact_lock(%d, hashtext(current_schema()))",
           SQL_LOCK_OBJECTS, SQL_LOCK_WRITES);
  int taken = run(l, sql);
  if (!taken) {
    let_all_go(l);
  }
  return taken;
}

/* The connection only reads otherwise. */
static int change(object_lock *l, const char *sql) {
  char text[512];
  snprintf(text, sizeof text, "BEGIN READ WRITE; %s; COMMIT", sql);
  int done = run(l, text);
  if (!done) {
    run(l, "ROLLBACK");
  }
  return done;
}

/* The check comes after the commit. A lock that is held now was held then, so any node that takes it later finds the
 * row. */
int object_lock_announce(object_lock *l) {
  char sql[384];
  snprintf(sql, sizeof sql,
           "DELETE FROM deletion WHERE until<clock_ms(); INSERT INTO deletion(node, until) VALUES('%s', clock_ms()+%d)"
           " ON CONFLICT(node) DO UPDATE SET until=excluded.until",
           l->name, (int)OBJECT_LOCK_DELETES_MS);
  if (!change(l, sql)) {
    return 0;
  }
  l->announced = 1;
  return holds_any(l);
}

void object_lock_keep_announced(object_lock *l) {
  l->kept_until = orb_clock_ms() + OBJECT_LOCK_DELETES_MS;
}

void object_lock_let_go(object_lock *l) {
  char sql[96];
  if (l->announced && orb_clock_ms() >= l->kept_until) {
    snprintf(sql, sizeof sql, "DELETE FROM deletion WHERE node='%s'", l->name);
    change(l, sql);
  }
  l->announced = 0;
  let_all_go(l);
}
