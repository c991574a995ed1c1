#include "store/object_removal.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>

#include "log.h"
#include "metrics.h"
#include "store/object_files.h"
#include "store/object_lock.h"
#include "store/objects_internal.h"
#include "store/vault.h"

/* While this process shares the lock, no backup begins. 0: a backup runs. The caller holds `deleting`. */
static int begin_deleting(const objects *store) {
  return store->backup_lock < 0 || store->holds_backups || flock(store->backup_lock, LOCK_SH | LOCK_NB) == 0 ||
         errno != EWOULDBLOCK;
}
static void end_deleting(const objects *store) {
  if (store->backup_lock >= 0 && !store->holds_backups) {
    flock(store->backup_lock, LOCK_UN);
  }
}

/* Call it before a request that deletes from the bucket, which is signed as of *at. It ensures that others are still
 * excluded, and that S3 refuses the request long before they go on without this node. */
static int announce(objects *store, int64_t *at) {
  *at = store->nodes ? vault_clock(store->vault) : 0;
  return store->excluded && (!store->nodes || object_lock_announce(store->nodes));
}

/* A request without an answer may still be on its way. */
static store_result answered(objects *store, store_result result) {
  if (store->nodes && result == STORE_AWAY) {
    object_lock_keep_announced(store->nodes);
  }
  return result;
}

static store_result unlink_object(objects *store, object_kind kind, const char *id) {
  if (store->vault) {
    char name[OBJECT_NAME];
    int64_t at;
    objects_name(kind, id, name);
    return announce(store, &at) ? answered(store, vault_delete(store->vault, name, at)) : STORE_AWAY;
  }
  return object_file_delete(store->root, kind, id);
}

store_result objects_delete(objects *store, object_kind kind, const char *id) {
  store_result result = STORE_OK;
  pthread_mutex_lock(&store->deleting);
  int deletes = begin_deleting(store);
  if (deletes) {
    result = unlink_object(store, kind, id);
    end_deleting(store);
  }
  if (!deletes || result == STORE_AWAY || result == STORE_CONFLICT) {
    result = STORE_OK;
    held_object *one = calloc(1, sizeof *one); /* if out of memory, the file stays until --gc */
    if (one) {
      *one = (held_object){.next = store->held, .kind = kind};
      snprintf(one->id, sizeof one->id, "%s", id);
      store->held = one;
    }
  }
  pthread_mutex_unlock(&store->deleting);
  return result;
}

int objects_backup_runs(objects *store) {
  pthread_mutex_lock(&store->deleting);
  int runs = !begin_deleting(store);
  if (!runs) {
    end_deleting(store);
  }
  pthread_mutex_unlock(&store->deleting);
  return runs;
}

int objects_hold_backups(objects *store) {
  pthread_mutex_lock(&store->deleting);
  store->holds_backups = begin_deleting(store);
  pthread_mutex_unlock(&store->deleting);
  return store->holds_backups;
}

/* Makes again what vault_read() found damaged, perhaps in a thread that held the store. */
static void heal_damaged(objects *store) {
  char name[VAULT_NAME];
  pthread_rwlock_rdlock(&store->healing);
  while (store->vault && vault_take_damaged(store->vault, name)) {
    object_kind kind;
    const char *id;
    int64_t at;
    metrics_quarantined();
    store_result dropped = objects_exclude(store) && announce(store, &at)
                               ? answered(store, vault_drop_damaged(store->vault, name, at))
                               : STORE_AWAY;
    objects_let_go(store);
    if (dropped == STORE_NOT_FOUND && objects_read_name(name, &kind, &id) && store->heal) {
      store->heal(store->heal_user, kind, id);
    }
  }
  pthread_rwlock_unlock(&store->healing);
}

void objects_settle(objects *store) {
  heal_damaged(store);
  pthread_rwlock_wrlock(&store->healing);
  pthread_rwlock_unlock(&store->healing);
}

static held_object *take_held(objects *store) {
  held_object *one = NULL;
  pthread_mutex_lock(&store->deleting);
  if (store->held && !objects_are_away(store) && begin_deleting(store)) {
    one = store->held;
    store->held = one->next;
    end_deleting(store);
  }
  pthread_mutex_unlock(&store->deleting);
  return one;
}

void objects_delete_held(objects *store, int (*is_named)(void *user, object_kind kind, const char *id), void *user) {
  heal_damaged(store);
  for (held_object *one; (one = take_held(store)); free(one)) {
    if (objects_exclude(store) && !is_named(user, one->kind, one->id)) {
      objects_delete(store, one->kind, one->id);
    }
    objects_let_go(store);
  }
}

void objects_on_quarantine(objects *store, void (*heal)(void *user, object_kind kind, const char *id), void *user) {
  store->heal = heal;
  store->heal_user = user;
}

store_result objects_quarantine(objects *store, object_kind kind, const char *id, int fd) {
  char aside[PATH_MAX], fields[160];
  if (store->remote.publish) {
    return STORE_NOT_FOUND; /* the daemon quarantines it */
  }
  snprintf(aside, sizeof aside, "%s/quarantine", store->root);
  store_result result = file_make_folder(aside);
  int moved = 0;
  size_t n = strlen(aside);
  snprintf(aside + n, sizeof aside - n, "/%s-%s-%lld", object_folder(kind), id, (long long)time(NULL));
  pthread_rwlock_rdlock(&store->healing);
  if (result == STORE_OK && store->vault) {
    char name[OBJECT_NAME];
    objects_name(kind, id, name);
    int64_t at;
    result = objects_exclude(store) && announce(store, &at)
                 ? answered(store, vault_quarantine(store->vault, name, fd, aside, at))
                 : STORE_AWAY;
    objects_let_go(store);
    moved = result == STORE_NOT_FOUND;
  } else if (result == STORE_OK) {
    (void)objects_exclude(store); /* the objects are files, so there are no other nodes */
    result = object_file_quarantine(store->root, kind, id, fd, aside, &moved);
    objects_let_go(store);
  }
  if (moved) {
    metrics_quarantined();
    snprintf(fields, sizeof fields, "\"object\":\"%s\",\"id\":\"%s\"", object_folder(kind), id);
    log_write(LOG_ERROR, fields, "a stored file does not match its hash and was moved to %s", aside);
    if (store->heal) {
      store->heal(store->heal_user, kind, id);
    }
  }
  pthread_rwlock_unlock(&store->healing);
  return result;
}

store_result objects_set_aside(objects *store, object_kind kind, const char *id) {
  char aside[PATH_MAX];
  snprintf(aside, sizeof aside, "%s/lost+found", store->root);
  store_result result = file_make_folder(aside);
  size_t n = strlen(aside);
  snprintf(aside + n, sizeof aside - n, "/%s-%s", object_folder(kind), id);
  if (result == STORE_OK && store->vault) {
    char name[OBJECT_NAME];
    objects_name(kind, id, name);
    int64_t at;
    result = announce(store, &at) ? answered(store, vault_set_aside(store->vault, name, aside, at)) : STORE_AWAY;
  } else if (result == STORE_OK) {
    result = object_file_set_aside(store->root, kind, id, aside);
  }
  if (result == STORE_OK) {
    utimensat(AT_FDCWD, aside, NULL, 0); /* objects_purge_lost() counts from now */
  }
  return result;
}

long objects_purge_lost(objects *store, int64_t before) {
  return object_files_purge_lost(store->root, before);
}
