#include "store/object_lock.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>

#include "store/database.h"

struct object_lock {
  pthread_mutex_t lock;
  database db;
  int sharing; /* threads; the first takes the lock of the database, the last gives it back */
  int shared;  /* it was taken for them */
};

object_lock *object_lock_open(const char *url) {
  object_lock *l = calloc(1, sizeof *l);
  if (!l) {
    return NULL;
  }
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

static int run(object_lock *l, const char *function) {
  char sql[96];
  snprintf(sql, sizeof sql, "SELECT pg_advisory_%s(%d, hashtext(current_schema()))", function, SQL_LOCK_OBJECTS);
  return database_execute(&l->db, sql) == SQL_OK;
}

/* A connection that was made again has no locks. */
int object_lock_holds(object_lock *l) {
  sql_statement *st = database_statement(
      &l->db, "SELECT count(*) FROM pg_locks WHERE locktype='advisory' AND pid=pg_backend_pid() AND granted");
  int holds = st && sql_step(st) == SQL_ROW && sql_integer(st, 0) > 0;
  sql_reset(st);
  return holds;
}

int object_lock_share(object_lock *l) {
  pthread_mutex_lock(&l->lock);
  l->shared = l->sharing++ > 0 && l->shared && object_lock_holds(l);
  l->shared = l->shared || run(l, "lock_shared");
  int shared = l->shared;
  pthread_mutex_unlock(&l->lock);
  return shared;
}

void object_lock_unshare(object_lock *l) {
  pthread_mutex_lock(&l->lock);
  if (--l->sharing == 0 && l->shared) {
    run(l, "unlock_shared");
  }
  pthread_mutex_unlock(&l->lock);
}

int object_lock_exclude(object_lock *l) {
  return run(l, "lock");
}

void object_lock_let_go(object_lock *l) {
  run(l, "unlock");
}
