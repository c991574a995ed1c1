#include "http/callers.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "store/owners.h"

struct callers {
  pthread_rwlock_t lock;
  pthread_mutex_t reading; /* held from reading the catalogue to storing the values, so a later read wins */
  catalogue *cat;
  caller **all;
  int count;
};

void caller_release(caller *who) {
  if (who && __atomic_sub_fetch(&who->refs, 1, __ATOMIC_ACQ_REL) == 0) {
    free(who);
  }
}

int caller_expired(const caller *who) {
  int64_t expires = who ? __atomic_load_n(&who->row.expires, __ATOMIC_RELAXED) : 0;
  return expires > 0 && (int64_t)time(NULL) >= expires;
}

int caller_revoked(const caller *who) {
  return who && (__atomic_load_n(&who->revoked, __ATOMIC_ACQUIRE) || caller_expired(who));
}

static caller *take_known(callers *c, const unsigned char hash[TOKEN_BYTES]) {
  for (int i = 0; i < c->count; i++) {
    caller *who = c->all[i];
    if (who && memcmp(who->row.hash, hash, TOKEN_BYTES) == 0) {
      c->all[i] = NULL;
      return who;
    }
  }
  return NULL;
}

static caller *make(const token_row *row) {
  caller *who = calloc(1, sizeof *who);
  if (who) {
    who->row = *row;
    who->refs = 1;
  }
  return who;
}

/* Copies what can change of a token. */
static void update(caller *who, const token_row *row) {
  __atomic_store_n(&who->row.scopes, row->scopes, __ATOMIC_RELAXED);
  __atomic_store_n(&who->row.used, row->used, __ATOMIC_RELAXED);
  __atomic_store_n(&who->row.quota, row->quota, __ATOMIC_RELAXED);
  __atomic_store_n(&who->row.quota_derived, row->quota_derived, __ATOMIC_RELAXED);
  __atomic_store_n(&who->row.jobs, row->jobs, __ATOMIC_RELAXED);
  __atomic_store_n(&who->row.priority, row->priority, __ATOMIC_RELAXED);
  __atomic_store_n(&who->row.expires, row->expires, __ATOMIC_RELAXED);
}

static int reload(callers *c) {
  int count, fine = 1;
  token_row *rows = catalogue_tokens(c->cat, &count);
  caller **all = rows ? calloc((size_t)count + 1, sizeof(caller *)) : NULL;
  if (!all) {
    free(rows);
    return 0;
  }
  pthread_rwlock_wrlock(&c->lock);
  for (int i = 0; i < count; i++) {
    all[i] = take_known(c, rows[i].hash);
    if (all[i]) {
      update(all[i], &rows[i]);
    } else {
      all[i] = make(&rows[i]); /* NULL if out of memory: unknown until the next reload, which the result reports */
      fine &= all[i] != NULL;
    }
  }
  for (int i = 0; i < c->count; i++) {
    if (c->all[i]) {
      __atomic_store_n(&c->all[i]->revoked, 1, __ATOMIC_RELEASE);
      caller_release(c->all[i]);
    }
  }
  free(c->all);
  c->all = all;
  c->count = count;
  pthread_rwlock_unlock(&c->lock);
  free(rows);
  return fine;
}

int callers_reload(callers *c) {
  pthread_mutex_lock(&c->reading);
  int fine = reload(c);
  pthread_mutex_unlock(&c->reading);
  return fine;
}

void callers_recount(callers *c, const char *tenant) {
  pthread_mutex_lock(&c->reading);
  int64_t used = catalogue_tenant_bytes(c->cat, tenant);
  pthread_rwlock_rdlock(&c->lock);
  for (int i = 0; used >= 0 && i < c->count; i++) {
    if (c->all[i] && strcmp(c->all[i]->row.tenant, tenant) == 0) {
      __atomic_store_n(&c->all[i]->row.used, used, __ATOMIC_RELAXED);
    }
  }
  pthread_rwlock_unlock(&c->lock);
  pthread_mutex_unlock(&c->reading);
}

int64_t callers_quota_derived(callers *c, const char *tenant) {
  int64_t least = 0;
  pthread_rwlock_rdlock(&c->lock);
  for (int i = 0; i < c->count; i++) {
    int64_t quota = c->all[i] && strcmp(c->all[i]->row.tenant, tenant) == 0
                        ? __atomic_load_n(&c->all[i]->row.quota_derived, __ATOMIC_RELAXED)
                        : 0;
    least = quota > 0 && (least == 0 || quota < least) ? quota : least;
  }
  pthread_rwlock_unlock(&c->lock);
  return least;
}

callers *callers_open(catalogue *cat) {
  callers *c = calloc(1, sizeof *c);
  if (!c) {
    return NULL;
  }
  c->cat = cat;
  pthread_rwlock_init(&c->lock, NULL);
  pthread_mutex_init(&c->reading, NULL);
  if (!callers_reload(c)) {
    callers_close(c);
    return NULL;
  }
  return c;
}

void callers_close(callers *c) {
  for (int i = 0; c && i < c->count; i++) {
    caller_release(c->all[i]);
  }
  if (c) {
    free(c->all);
    pthread_rwlock_destroy(&c->lock);
    pthread_mutex_destroy(&c->reading);
  }
  free(c);
}

int callers_count(callers *c) {
  pthread_rwlock_rdlock(&c->lock);
  int count = c->count;
  pthread_rwlock_unlock(&c->lock);
  return count;
}

caller *callers_find(callers *c, const unsigned char hash[TOKEN_BYTES]) {
  caller *found = NULL;
  pthread_rwlock_rdlock(&c->lock);
  for (int i = 0; i < c->count; i++) { /* always all of them: the time must not depend on the token */
    if (c->all[i] && sodium_memcmp(hash, c->all[i]->row.hash, TOKEN_BYTES) == 0) {
      found = c->all[i];
    }
  }
  if (found) {
    __atomic_add_fetch(&found->refs, 1, __ATOMIC_RELAXED);
  }
  pthread_rwlock_unlock(&c->lock);
  return found;
}
