#include "store/objects.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/sendfile.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <time.h>
#include <unistd.h>

#include "api/ids.h"
#include "faults.h"
#include "hash.h"
#include "store/object_files.h"
#include "store/object_lock.h"
#include "store/objects_internal.h"
#include "store/vault.h"

_Static_assert((int)OBJECT_NAME == (int)VAULT_NAME, "a name of an object is one of the vault");

void objects_name(object_kind kind, const char *id, char out[OBJECT_NAME]) {
  snprintf(out, OBJECT_NAME, "%s/%.2s/%.80s", object_folder(kind), id, id);
}

int objects_read_name(const char *name, object_kind *kind, const char **id) {
  size_t folder = strcspn(name, "/");
  const char *slash = strrchr(name, '/');
  for (int k = 0; slash && k < OBJECT_KINDS; k++) {
    const char *known = object_folder((object_kind)k);
    if (strlen(known) == folder && strncmp(known, name, folder) == 0) {
      *kind = (object_kind)k;
      *id = slash + 1;
      return strlen(*id) == API_ID_SIZE - 1 && (*id)[strspn(*id, "0123456789abcdef")] == 0;
    }
  }
  return 0;
}

void objects_path(const objects *store, object_kind kind, const char *id, char out[PATH_MAX]) {
  object_file_path(store->root, kind, id, out);
}

/* Makes a store that has no files yet. data NULL: it never has any. Returns NULL if out of memory, or if the path is
 * too long.
 */
static objects *create(const char *data) {
  objects *store = calloc(1, sizeof *store);
  if (!store || !(store->verified = marks_create()) ||
      (data && snprintf(store->root, sizeof store->root, "%s", data) >= (int)sizeof store->root)) {
    marks_destroy(store ? store->verified : NULL);
    free(store);
    return NULL;
  }
  pthread_rwlockattr_t attributes;
  pthread_rwlockattr_init(&attributes);
  pthread_rwlockattr_setkind_np(&attributes, PTHREAD_RWLOCK_PREFER_WRITER_NONRECURSIVE_NP);
  pthread_rwlock_init(&store->publishing, &attributes);
  pthread_rwlock_init(&store->healing, NULL);
  pthread_rwlockattr_destroy(&attributes);
  pthread_mutex_init(&store->deleting, NULL);
  store->backup_lock = -1;
  return store;
}

int objects_backup_lock(const char *data) {
  char path[PATH_MAX];
  snprintf(path, sizeof path, "%s/backup.lock", data);
  int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (fd < 0) {
    file_failed("open", path);
  }
  return fd;
}

store_result objects_open(const char *data, objects **out) {
  objects *store = create(data);
  store_result status = store ? object_files_make(store->root) : STORE_ERROR;
  if (status == STORE_OK && (store->backup_lock = objects_backup_lock(data)) < 0) {
    status = STORE_ERROR;
  }
  if (status != STORE_OK) {
    objects_close(store);
    return status;
  }
  object_files_sweep(store->root);
  *out = store;
  return STORE_OK;
}

store_result objects_open_bucket(const char *data, object_bucket *b, uint64_t most, objects **out) {
  objects *store = create(data);
  store_result status = store ? object_files_make_top(store->root) : STORE_ERROR;
  if (status == STORE_OK && !(store->vault = vault_open(data, b, most))) {
    status = STORE_ERROR;
  }
  if (status != STORE_OK) {
    bucket_close(b);
    objects_close(store);
    return status;
  }
  object_files_sweep(store->root);
  *out = store;
  return STORE_OK;
}

store_result objects_open_read_only(const char *data, objects **out) {
  *out = create(data);
  return *out ? STORE_OK : STORE_ERROR;
}

store_result objects_open_remote(const objects_remote *remote, objects **out) {
  objects *store = create(NULL);
  if (!store) {
    return STORE_ERROR;
  }
  store->remote = *remote;
  *out = store;
  return STORE_OK;
}

void objects_close(objects *store) {
  if (!store) {
    return;
  }
  for (held_object *one; (one = store->held);) {
    store->held = one->next;
    free(one);
  }
  if (store->backup_lock >= 0) {
    close(store->backup_lock);
  }
  vault_close(store->vault);
  marks_destroy(store->verified);
  pthread_mutex_destroy(&store->deleting);
  pthread_rwlock_destroy(&store->publishing);
  pthread_rwlock_destroy(&store->healing);
  object_lock_close(store->nodes);
  free(store);
}

void objects_share(objects *store, object_lock *lock) {
  store->nodes = lock;
}

/* If the lock cannot be taken, because the database is unreachable, the commit of the row will fail:
 * object_lock_check(). */
void objects_hold(objects *store) {
  pthread_rwlock_rdlock(&store->publishing);
  if (store->nodes) {
    object_lock_share(store->nodes);
  }
}
int objects_exclude(objects *store) {
  pthread_rwlock_wrlock(&store->publishing);
  store->excludes = 1;
  store->excluded = !store->nodes || object_lock_exclude(store->nodes);
  return store->excluded;
}
void objects_let_go(objects *store) {
  if (store->nodes && !store->excludes) {
    object_lock_unshare(store->nodes);
  } else if (store->nodes && store->excluded) {
    object_lock_let_go(store->nodes);
  }
  if (store->excludes) { /* only a thread that holds the lock alone may write it */
    store->excludes = 0;
    store->excluded = 0;
  }
  pthread_rwlock_unlock(&store->publishing);
}
void objects_hold_again(objects *store) {
  objects_let_go(store);
  objects_hold(store);
}

store_result objects_begin(objects *store, object_temp *temp) {
  char path[PATH_MAX];
  if (store->remote.publish) {
    *temp = (object_temp){.fd = dup(store->remote.file), .store = store};
    temp->start = temp->fd >= 0 ? lseek(temp->fd, 0, SEEK_END) : -1;
    return temp->start >= 0 ? STORE_OK : file_failed("create", "an object in memory");
  }
  snprintf(path, sizeof path, "%s/tmp/put-XXXXXX", store->root);
  temp->fd = mkostemp(path, O_CLOEXEC);
  temp->store = store;
  snprintf(temp->name, sizeof temp->name, "%s", strrchr(path, '/') + 1);
  FAULT_POINT("temp-begun");
  return temp->fd >= 0 ? STORE_OK : file_failed("create", path);
}

store_result objects_append(object_temp *temp, const void *bytes, size_t size) {
  const char *at = bytes;
  const objects_remote *remote = &temp->store->remote;
  if (remote->publish && orb_memory_charge(remote->ctx, size) != ORB_OK) {
    return STORE_FULL;
  }
  while (size) {
    ssize_t n = write(temp->fd, at, size);
    if (n < 0 && errno == EINTR) {
      continue;
    }
    if (n <= 0) {
      return file_failed("write", temp->name);
    }
    at += n;
    size -= (size_t)n;
    if (!remote->publish) {
      FAULT_POINT("temp-written");
    }
  }
  return STORE_OK;
}

static void temp_path(const object_temp *temp, char out[PATH_MAX]) {
  snprintf(out, PATH_MAX, "%s/tmp/%s", temp->store->root, temp->name);
}

void objects_abandon(object_temp *temp) {
  char path[PATH_MAX];
  if (temp->fd >= 0) {
    close(temp->fd);
    temp->fd = -1;
    if (!temp->store->remote.publish) {
      temp_path(temp, path);
      unlink(path);
    }
  }
}

store_result objects_publish(objects *store, object_temp *temp, object_kind kind, const char *id) {
  char from[PATH_MAX], name[OBJECT_NAME];
  if (store->remote.publish) {
    const int64_t size = lseek(temp->fd, 0, SEEK_CUR) - temp->start;
    store_result status = store->remote.publish(store->remote.user, kind, id, temp->start, size);
    objects_abandon(temp);
    return status;
  }
  temp_path(temp, from);
  objects_name(kind, id, name);
  store_result status = store->vault ? vault_publish(store->vault, name, temp->fd, from)
                                     : object_file_publish(store->root, kind, id, temp->fd, from);
  close(temp->fd);
  temp->fd = -1;
  return status;
}

store_result objects_put(objects *store, object_kind kind, const char *id, const void *bytes, size_t size) {
  object_temp temp;
  store_result status = objects_begin(store, &temp);
  if (status == STORE_OK) {
    status = objects_append(&temp, bytes, size);
    if (status == STORE_OK) {
      status = objects_publish(store, &temp, kind, id);
    }
    objects_abandon(&temp);
  }
  return status;
}

store_result objects_copy(objects *store, orb_context *ctx, int from, int64_t start, int64_t size, object_temp *temp) {
  enum { COPY_BYTES = 16 << 20 };
  store_result stored = objects_begin(store, temp);
  off_t at = start;
  while (stored == STORE_OK && at - start < size) {
    off_t left = size - (at - start);
    ssize_t n = sendfile(temp->fd, from, &at, (size_t)(left < COPY_BYTES ? left : COPY_BYTES));
    if (n == 0) {
      stored = STORE_ERROR; /* the process has written less */
    } else if (n < 0 && errno != EINTR) {
      stored = errno == ENOSPC || errno == EDQUOT || errno == EFBIG ? STORE_FULL : STORE_ERROR;
    } else if (orb_context_check(ctx) != ORB_OK) {
      stored = STORE_ERROR;
    }
    FAULT_POINT("temp-written");
  }
  return stored;
}

store_result objects_read(const objects *store, object_kind kind, const char *id, int *fd, uint64_t *size) {
  if (store->remote.read) {
    return store->remote.read(store->remote.user, kind, id, fd, size);
  }
  if (store->vault) {
    char name[OBJECT_NAME];
    objects_name(kind, id, name);
    return vault_read(store->vault, name, fd, size);
  }
  return object_file_read(store->root, kind, id, fd, size);
}

store_result objects_look(const objects *store, object_kind kind, const char *id) {
  if (store->vault) {
    char name[OBJECT_NAME];
    objects_name(kind, id, name);
    return vault_look(store->vault, name);
  }
  return object_file_look(store->root, kind, id);
}

int objects_is_near(const objects *store, object_kind kind, const char *id) {
  char name[OBJECT_NAME];
  objects_name(kind, id, name);
  return !store->vault || vault_copy(store->vault, name);
}

int objects_are_remote(const objects *store) {
  return store->vault != NULL;
}

int objects_go_to_bucket(const objects *store) {
  return store->vault != NULL || store->remote.bucket;
}

int objects_are_away(const objects *store) {
  return store->vault && vault_is_away(store->vault);
}

int objects_were_away(const objects *store, int64_t since) {
  return store->vault && vault_was_away(store->vault, since);
}

int objects_link(const objects *store, object_kind kind, const char *id, long seconds, const char *more,
                 char out[BUCKET_LINK]) {
  char name[OBJECT_NAME];
  objects_name(kind, id, name);
  return store->vault && vault_link(store->vault, name, seconds, more, out);
}

store_result objects_load(const objects *store, object_kind kind, const char *id, unsigned char **bytes, size_t *size) {
  int fd;
  uint64_t length;
  store_result status = objects_read(store, kind, id, &fd, &length);
  if (status != STORE_OK) {
    return status;
  }
  unsigned char *data = malloc(length ? length : 1);
  size_t done = 0;
  while (data && done < length) {
    ssize_t n = read(fd, data + done, length - done);
    if (n < 0 && errno == EINTR) {
      continue;
    }
    if (n <= 0) {
      break;
    }
    done += (size_t)n;
  }
  close(fd);
  if (!data || done < length) {
    free(data);
    return STORE_ERROR;
  }
  *bytes = data;
  *size = length;
  return STORE_OK;
}

/* The mark refers to a copy: a copy that is fetched from S3 again has another one. */
static uint64_t hash_of(const objects *store, object_kind kind, const char *id) {
  char text[104];
  int n = snprintf(text, sizeof text, "%d %.80s", (int)kind, id);
  if (store->vault) {
    char name[OBJECT_NAME];
    objects_name(kind, id, name);
    n += snprintf(text + n, sizeof text - (size_t)n, " %llx", (unsigned long long)vault_copy(store->vault, name));
  }
  return keyed_hash(text, n < (int)sizeof text ? (size_t)n : sizeof text - 1);
}

void objects_mark(objects *store, object_kind kind, const char *id) {
  marks_add(store->verified, hash_of(store, kind, id));
}

int objects_is_marked(const objects *store, object_kind kind, const char *id) {
  return objects_is_near(store, kind, id) && marks_have(store->verified, hash_of(store, kind, id));
}

int objects_is_read_only(const objects *store) {
  struct statvfs info;
  return !store->remote.publish && statvfs(store->root, &info) == 0 && (info.f_flag & ST_RDONLY);
}

uint64_t objects_free_bytes(const objects *store) {
  if (store->remote.publish) {
    return UINT64_MAX; /* the daemon checks */
  }
  struct statvfs info;
  return statvfs(store->root, &info) == 0 ? (uint64_t)info.f_bavail * info.f_frsize : UINT64_MAX;
}

/* Gives a name of the vault as kind and id. */
typedef struct named_visit {
  void (*each)(void *user, object_kind kind, const char *id, uint64_t size);
  void *user;
} named_visit;

static void visit(void *user, const char *name, uint64_t size) {
  const named_visit *v = user;
  object_kind kind;
  const char *id;
  if (objects_read_name(name, &kind, &id)) {
    v->each(v->user, kind, id, size);
  }
}

store_result objects_each(const objects *store,
                          void (*each)(void *user, object_kind kind, const char *id, uint64_t size), void *user) {
  if (store->vault) {
    return vault_each(store->vault, visit, &(named_visit){each, user});
  }
  return object_files_each(store->root, each, user);
}
