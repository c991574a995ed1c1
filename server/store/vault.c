#include "store/vault.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "faults.h"
#include "log.h"
#include "store/object_cache.h"

typedef struct damaged {
  struct damaged *next;
  char name[VAULT_NAME];
} damaged;

struct vault {
  object_bucket *bucket;
  object_cache *cache;
  pthread_mutex_t lock;
  damaged *damaged;
  char root[PATH_MAX - 256];
};

vault *vault_open(const char *data, object_bucket *b, uint64_t most) {
  char folder[PATH_MAX];
  vault *v = calloc(1, sizeof *v);
  int n = v ? snprintf(v->root, sizeof v->root, "%s", data) : -1;
  if (n < 0 || n >= (int)sizeof v->root) {
    free(v);
    return NULL;
  }
  snprintf(folder, sizeof folder, "%s/cache", data);
  if (mkdir(folder, 0700) != 0 && errno != EEXIST) {
    log_error("mkdir %s: %s", folder, strerror(errno));
    free(v);
    return NULL;
  }
  v->cache = object_cache_open(folder, most);
  if (!v->cache) {
    free(v);
    return NULL;
  }
  pthread_mutex_init(&v->lock, NULL);
  v->bucket = b;
  return v;
}

void vault_close(vault *v) {
  if (!v) {
    return;
  }
  char name[VAULT_NAME];
  while (vault_take_damaged(v, name)) {
  }
  bucket_close(v->bucket);
  object_cache_close(v->cache);
  pthread_mutex_destroy(&v->lock);
  free(v);
}

static void path_of(const vault *v, const char *name, char out[PATH_MAX]) {
  snprintf(out, PATH_MAX, "%s/cache/%s", v->root, name);
}

/* Moves a file to its place in the cache. A failure only costs another download. */
static int keep(vault *v, const char *name, const char *from) {
  char path[PATH_MAX];
  struct stat info;
  path_of(v, name, path);
  for (int tries = 0; tries < 2; tries++) {
    if (rename(from, path) == 0) {
      object_cache_grew(v->cache, stat(path, &info) == 0 ? (uint64_t)info.st_size : 0);
      return 1;
    }
    for (char *slash = strchr(path + strlen(v->root) + strlen("/cache/"), '/'); slash; slash = strchr(slash + 1, '/')) {
      *slash = 0;
      mkdir(path, 0700);
      *slash = '/';
    }
  }
  log_warn("a copy of an object cannot be kept as %s: %s", path, strerror(errno));
  return 0;
}

store_result vault_publish(vault *v, const char *name, int fd, const char *path) {
  FAULT_POINT("publish-written");
  store_result result = bucket_put(v->bucket, name, fd);
  FAULT_POINT("publish-uploaded");
  if (result == STORE_OK) {
    object_cache_used(fd);
  }
  if (result != STORE_OK || !keep(v, name, path)) {
    unlink(path);
  }
  return result;
}

static store_result open_copy(const vault *v, const char *name, int *fd, uint64_t *size) {
  char path[PATH_MAX];
  struct stat info;
  path_of(v, name, path);
  *fd = open(path, O_RDONLY | O_CLOEXEC);
  if (*fd < 0 || fstat(*fd, &info) != 0) {
    if (*fd >= 0) {
      close(*fd);
    }
    return STORE_NOT_FOUND;
  }
  object_cache_used(*fd);
  *size = (uint64_t)info.st_size;
  return STORE_OK;
}

static void name_aside(const vault *v, const char *name, char out[PATH_MAX]) {
  char flat[VAULT_NAME];
  snprintf(flat, sizeof flat, "%.*s-%s", (int)strcspn(name, "/"), name, strrchr(name, '/') + 1);
  snprintf(out, PATH_MAX, "%s/quarantine", v->root);
  mkdir(out, 0700);
  snprintf(out, PATH_MAX, "%s/quarantine/%s-%lld", v->root, flat, (long long)time(NULL));
}

/* 0: it is noted already, or there is no memory. */
static int note_damaged(vault *v, const char *name) {
  int known = 0;
  pthread_mutex_lock(&v->lock);
  for (const damaged *one = v->damaged; one && !known; one = one->next) {
    known = strcmp(one->name, name) == 0;
  }
  damaged *one = known ? NULL : calloc(1, sizeof *one);
  if (one) {
    snprintf(one->name, sizeof one->name, "%s", name);
    one->next = v->damaged;
    v->damaged = one;
  }
  pthread_mutex_unlock(&v->lock);
  return one != NULL;
}

/* Keeps wrong bytes and notes their name. The thread that takes the name deletes the object from the bucket. This
 * thread may be a publisher, which cannot exclude others. */
static void set_damaged(vault *v, const char *name, const char *from) {
  char aside[PATH_MAX];
  if (!note_damaged(v, name)) {
    return; /* its bytes have been kept */
  }
  name_aside(v, name, aside);
  if (rename(from, aside) == 0) {
    log_error("an object in S3 does not match its hash and was moved to %s", aside);
  } else {
    log_error("the damaged object %s could not be moved to %s", name, aside);
  }
}

int vault_take_damaged(vault *v, char name[VAULT_NAME]) {
  pthread_mutex_lock(&v->lock);
  damaged *one = v->damaged;
  if (one) {
    v->damaged = one->next;
    snprintf(name, VAULT_NAME, "%s", one->name);
  }
  pthread_mutex_unlock(&v->lock);
  free(one);
  return one != NULL;
}

store_result vault_read(vault *v, const char *name, int *fd, uint64_t *size) {
  char temp[PATH_MAX];
  if (open_copy(v, name, fd, size) == STORE_OK) {
    return STORE_OK;
  }
  snprintf(temp, sizeof temp, "%s/tmp/get-XXXXXX", v->root);
  int file = mkostemp(temp, O_CLOEXEC);
  if (file < 0) {
    log_error("create %s: %s", temp, strerror(errno));
    return errno == ENOSPC ? STORE_FULL : STORE_ERROR;
  }
  store_result result = bucket_get(v->bucket, name, file, size);
  if (result == STORE_OK) {
    *fd = open(temp, O_RDONLY | O_CLOEXEC); /* before it may be deleted again */
    result = *fd >= 0 ? STORE_OK : STORE_ERROR;
    if (result == STORE_OK) {
      object_cache_used(*fd);
    }
    if (result != STORE_OK || !keep(v, name, temp)) {
      unlink(temp);
    }
  } else if (result == STORE_CONFLICT) {
    set_damaged(v, name, temp);
    result = STORE_NOT_FOUND;
  }
  if (result != STORE_OK) {
    unlink(temp);
  }
  close(file);
  return result;
}

store_result vault_drop_damaged(vault *v, const char *name, int64_t signed_at) {
  char temp[PATH_MAX];
  uint64_t size;
  snprintf(temp, sizeof temp, "%s/tmp/get-XXXXXX", v->root);
  int file = mkostemp(temp, O_CLOEXEC);
  if (file < 0) {
    log_error("create %s: %s", temp, strerror(errno));
    return STORE_ERROR;
  }
  store_result result = bucket_get(v->bucket, name, file, &size);
  close(file);
  unlink(temp);
  if (result == STORE_CONFLICT) { /* it is as damaged as before */
    result = bucket_delete(v->bucket, name, signed_at);
    return result == STORE_OK ? STORE_NOT_FOUND : result;
  }
  return result;
}

store_result vault_look(vault *v, const char *name) {
  return bucket_look(v->bucket, name, NULL, NULL);
}

int64_t vault_clock(vault *v) {
  return bucket_clock(v->bucket);
}

store_result vault_delete(vault *v, const char *name, int64_t signed_at) {
  char path[PATH_MAX];
  path_of(v, name, path);
  unlink(path);
  FAULT_POINT("before-unlink");
  return bucket_delete(v->bucket, name, signed_at);
}

store_result vault_each(vault *v, void (*each)(void *user, const char *name, uint64_t size), void *user) {
  return bucket_each(v->bucket, each, user);
}

uint64_t vault_copy(const vault *v, const char *name) {
  char path[PATH_MAX];
  struct stat info;
  path_of(v, name, path);
  return stat(path, &info) == 0 ? (uint64_t)info.st_ino ^ ((uint64_t)info.st_mtim.tv_sec << 30) ^
                                      ((uint64_t)info.st_mtim.tv_nsec << 1) ^ (UINT64_C(1) << 63)
                                : 0;
}

store_result vault_quarantine(vault *v, const char *name, int fd, const char *aside, int64_t signed_at) {
  char path[PATH_MAX], here[65], there[65] = "";
  struct stat read, named;
  path_of(v, name, path);
  if (fstat(fd, &read) != 0 || !bucket_hash(fd, 0, (uint64_t)read.st_size, here)) {
    return STORE_ERROR;
  }
  if (stat(path, &named) == 0 && named.st_ino == read.st_ino && rename(path, aside) != 0) {
    unlink(path);
  }
  store_result result = bucket_look(v->bucket, name, there, NULL);
  if (result == STORE_OK && strcmp(here, there) == 0) {
    result = bucket_delete(v->bucket, name, signed_at);
    return result == STORE_OK ? STORE_NOT_FOUND : result;
  }
  return result;
}

store_result vault_set_aside(vault *v, const char *name, const char *aside, int64_t signed_at) {
  char path[PATH_MAX];
  int fd;
  uint64_t size;
  int64_t modified;
  store_result result = bucket_look(v->bucket, name, NULL, &modified);
  if (result == STORE_OK && modified > (int64_t)time(NULL) - VAULT_GRACE_S) {
    return STORE_CONFLICT;
  }
  result = result == STORE_OK ? vault_read(v, name, &fd, &size) : result;
  if (result != STORE_OK) {
    return result;
  }
  close(fd);
  path_of(v, name, path);
  if (rename(path, aside) != 0) {
    log_error("rename to %s: %s", aside, strerror(errno));
    return STORE_ERROR;
  }
  return bucket_delete(v->bucket, name, signed_at);
}

int vault_is_away(vault *v) {
  return bucket_is_away(v->bucket);
}

int vault_was_away(vault *v, int64_t since) {
  return bucket_was_away(v->bucket, since);
}

int vault_link(vault *v, const char *name, long seconds, const char *more, char out[BUCKET_LINK]) {
  return bucket_link(v->bucket, name, seconds, more, out);
}
