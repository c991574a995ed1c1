#include "store/objects.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <time.h>
#include <unistd.h>

#include "api/ids.h"
#include "faults.h"
#include "hash.h"
#include "log.h"
#include "metrics.h"
#include "store/marks.h"
#include "store/object_lock.h"
#include "store/vault.h"

static const char *const folders[OBJECT_KINDS] = {"mesh",    "sphere",    "asset",   "places",
                                                  "spheres", "quantized", "meshopt", "alignment"};

/* An object whose file is to be deleted when no backup runs. */
typedef struct held_object {
  struct held_object *next;
  object_kind kind;
  char id[80];
} held_object;

struct objects {
  pthread_rwlock_t publishing;
  object_lock *nodes;     /* that share the bucket; NULL: there are none */
  int excludes, excluded; /* of the thread that holds `publishing` alone */
  pthread_mutex_t deleting;
  int backup_lock; /* −1: none */
  int holds_backups;
  held_object *held;
  marks *verified;
  char root[PATH_MAX - 256];
  objects_remote remote; /* publish NULL: the store has files */
  vault *vault;          /* NULL: the objects are files */
  void (*heal)(void *user, object_kind kind, const char *id);
  void *heal_user;
};

static store_result failed(const char *what, const char *path) {
  int code = errno;
  log_error("%s %s: %s", what, path, strerror(code));
  return code == ENOSPC || code == EDQUOT || code == EFBIG ? STORE_FULL : STORE_ERROR;
}

_Static_assert((int)OBJECT_NAME == (int)VAULT_NAME, "a name of an object is one of the vault");

void objects_name(object_kind kind, const char *id, char out[OBJECT_NAME]) {
  snprintf(out, OBJECT_NAME, "%s/%.2s/%.80s", folders[kind], id, id);
}

int objects_read_name(const char *name, object_kind *kind, const char **id) {
  size_t folder = strcspn(name, "/");
  const char *slash = strrchr(name, '/');
  for (int k = 0; slash && k < OBJECT_KINDS; k++) {
    if (strlen(folders[k]) == folder && strncmp(folders[k], name, folder) == 0) {
      *kind = (object_kind)k;
      *id = slash + 1;
      return strlen(*id) == API_ID_SIZE - 1 && (*id)[strspn(*id, "0123456789abcdef")] == 0;
    }
  }
  return 0;
}

void objects_path(const objects *store, object_kind kind, const char *id, char out[PATH_MAX]) {
  snprintf(out, PATH_MAX, "%s/objects/%s/%.2s/%s", store->root, folders[kind], id, id);
}

static store_result sync_folder(const char *path) {
  int fd = open(path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) {
    return failed("open", path);
  }
  int result = fsync(fd);
  store_result status = result == 0 ? STORE_OK : failed("fsync", path);
  close(fd);
  return status;
}

static store_result make_folder(const char *path) {
  return mkdir(path, 0700) == 0 || errno == EEXIST ? STORE_OK : failed("mkdir", path);
}

static void sweep(const char *folder) {
  DIR *dir = opendir(folder);
  if (!dir) {
    return;
  }
  int swept = 0;
  for (struct dirent *entry; (entry = readdir(dir));) {
    if (entry->d_name[0] != '.') {
      swept += unlinkat(dirfd(dir), entry->d_name, 0) == 0;
    }
  }
  closedir(dir);
  if (swept) {
    log_info("deleted %d temporary files", swept);
  }
}

/* The folders of objects of one kind are made with their first object: 256 a kind would take most of a first start. */
store_result objects_make_folder(const objects *store, object_kind kind, const char *id) {
  char path[PATH_MAX];
  snprintf(path, sizeof path, "%s/objects/%s/%.2s", store->root, folders[kind], id);
  store_result status = make_folder(path);
  *strrchr(path, '/') = 0;
  return status == STORE_OK ? sync_folder(path) : status; /* another thread may have made it and not synced it yet */
}

static store_result make_top(const objects *store) {
  char path[PATH_MAX];
  snprintf(path, sizeof path, "%s/tmp", store->root);
  store_result status = make_folder(store->root);
  return status == STORE_OK ? make_folder(path) : status;
}

static store_result make_folders(const objects *store) {
  char path[PATH_MAX];
  snprintf(path, sizeof path, "%s/objects", store->root);
  store_result status = make_top(store);
  status = status == STORE_OK ? make_folder(path) : status;
  for (int kind = 0; kind < OBJECT_KINDS && status == STORE_OK; kind++) {
    snprintf(path, sizeof path, "%s/objects/%s", store->root, folders[kind]);
    status = make_folder(path);
  }
  snprintf(path, sizeof path, "%s/objects", store->root);
  status = status == STORE_OK ? sync_folder(path) : status;
  return status == STORE_OK ? sync_folder(store->root) : status;
}

/* A store without files of its own so far; data NULL: it will have none. NULL: out of memory, or the path is too long.
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
    failed("open", path);
  }
  return fd;
}

static void sweep_temporary(const objects *store) {
  char path[PATH_MAX];
  snprintf(path, sizeof path, "%s/tmp", store->root);
  sweep(path);
}

store_result objects_open(const char *data, objects **out) {
  objects *store = create(data);
  store_result status = store ? make_folders(store) : STORE_ERROR;
  if (status == STORE_OK && (store->backup_lock = objects_backup_lock(data)) < 0) {
    status = STORE_ERROR;
  }
  if (status != STORE_OK) {
    objects_close(store);
    return status;
  }
  sweep_temporary(store);
  *out = store;
  return STORE_OK;
}

store_result objects_open_bucket(const char *data, object_bucket *b, uint64_t most, objects **out) {
  objects *store = create(data);
  store_result status = store ? make_top(store) : STORE_ERROR;
  if (status == STORE_OK && !(store->vault = vault_open(data, b, most))) {
    status = STORE_ERROR;
  }
  if (status != STORE_OK) {
    bucket_close(b);
    objects_close(store);
    return status;
  }
  sweep_temporary(store);
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
  object_lock_close(store->nodes);
  free(store);
}

void objects_share(objects *store, object_lock *lock) {
  store->nodes = lock;
}

/* If the lock cannot be taken, because the database is away, the commit of the row will fail: object_lock_check(). */
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
  store->excludes = 0; /* set only while one thread has the lock alone */
  pthread_rwlock_unlock(&store->publishing);
}
void objects_hold_again(objects *store) {
  objects_let_go(store);
  objects_hold(store);
}
int objects_still_excludes(objects *store) {
  return store->excluded && (!store->nodes || object_lock_holds(store->nodes));
}

store_result objects_begin(objects *store, object_temp *temp) {
  char path[PATH_MAX];
  if (store->remote.publish) {
    *temp = (object_temp){.fd = memfd_create("object", MFD_CLOEXEC), .store = store};
    return temp->fd >= 0 ? STORE_OK : failed("create", "an object in memory");
  }
  snprintf(path, sizeof path, "%s/tmp/put-XXXXXX", store->root);
  temp->fd = mkostemp(path, O_CLOEXEC);
  temp->store = store;
  snprintf(temp->name, sizeof temp->name, "%s", strrchr(path, '/') + 1);
  FAULT_POINT("temp-begun");
  return temp->fd >= 0 ? STORE_OK : failed("create", path);
}

store_result objects_append(object_temp *temp, const void *bytes, size_t size) {
  const char *at = bytes;
  while (size) {
    ssize_t n = write(temp->fd, at, size);
    if (n < 0 && errno == EINTR) {
      continue;
    }
    if (n <= 0) {
      return failed("write", temp->name);
    }
    at += n;
    size -= (size_t)n;
    if (!temp->store->remote.publish) {
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
  char path[PATH_MAX], from[PATH_MAX];
  if (store->remote.publish) {
    store_result status = store->remote.publish(store->remote.user, kind, id, temp->fd);
    objects_abandon(temp);
    return status;
  }
  if (store->vault) {
    char name[OBJECT_NAME];
    objects_name(kind, id, name);
    temp_path(temp, from);
    store_result status = vault_publish(store->vault, name, temp->fd, from);
    close(temp->fd);
    temp->fd = -1;
    return status;
  }
  objects_path(store, kind, id, path);
  FAULT_POINT("publish-written");
  if (fsync(temp->fd) != 0) {
    store_result status = failed("fsync", temp->name);
    objects_abandon(temp);
    return status;
  }
  FAULT_POINT("publish-synced");
  temp_path(temp, from);
  store_result status = STORE_OK;
  int renamed = rename(from, path) == 0;
  if (!renamed && errno == ENOENT && (status = objects_make_folder(store, kind, id)) == STORE_OK) {
    FAULT_POINT("publish-folder");
    renamed = rename(from, path) == 0;
  }
  if (!renamed) {
    status = status == STORE_OK ? failed("rename to", path) : status;
    objects_abandon(temp);
    return status;
  }
  close(temp->fd);
  temp->fd = -1;
  FAULT_POINT("publish-renamed");
  *strrchr(path, '/') = 0;
  store_result synced = sync_folder(path);
  FAULT_POINT("publish-done");
  return synced;
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

store_result objects_read(const objects *store, object_kind kind, const char *id, int *fd, uint64_t *size) {
  char path[PATH_MAX];
  struct stat info;
  if (store->remote.read) {
    return store->remote.read(store->remote.user, kind, id, fd, size);
  }
  if (store->vault) {
    char name[OBJECT_NAME];
    objects_name(kind, id, name);
    return vault_read(store->vault, name, fd, size);
  }
  objects_path(store, kind, id, path);
  *fd = open(path, O_RDONLY | O_CLOEXEC);
  if (*fd < 0) {
    return errno == ENOENT ? STORE_NOT_FOUND : failed("open", path);
  }
  if (fstat(*fd, &info) != 0) {
    store_result status = failed("stat", path);
    close(*fd);
    return status;
  }
  *size = (uint64_t)info.st_size;
  return STORE_OK;
}

store_result objects_look(const objects *store, object_kind kind, const char *id) {
  char path[PATH_MAX];
  if (store->vault) {
    char name[OBJECT_NAME];
    objects_name(kind, id, name);
    return vault_look(store->vault, name);
  }
  objects_path(store, kind, id, path);
  return access(path, F_OK) == 0 ? STORE_OK : errno == ENOENT ? STORE_NOT_FOUND : failed("look at", path);
}

int objects_is_near(const objects *store, object_kind kind, const char *id) {
  char name[OBJECT_NAME];
  objects_name(kind, id, name);
  return !store->vault || vault_copy(store->vault, name);
}

int objects_are_remote(const objects *store) {
  return store->vault != NULL;
}

int objects_are_away(const objects *store) {
  return store->vault && vault_is_away(store->vault);
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

static store_result unlink_object(const objects *store, object_kind kind, const char *id) {
  char path[PATH_MAX];
  if (store->vault) {
    char name[OBJECT_NAME];
    objects_name(kind, id, name);
    return vault_delete(store->vault, name);
  }
  objects_path(store, kind, id, path);
  FAULT_POINT("before-unlink");
  return unlink(path) == 0 || errno == ENOENT ? STORE_OK : failed("unlink", path);
}

store_result objects_delete(objects *store, object_kind kind, const char *id) {
  store_result result = STORE_OK;
  pthread_mutex_lock(&store->deleting);
  int deletes = begin_deleting(store);
  if (deletes) {
    result = unlink_object(store, kind, id);
    end_deleting(store);
  }
  if (!deletes || result == STORE_AWAY) {
    result = STORE_OK;
    held_object *one = calloc(1, sizeof *one); /* without memory the file stays until --gc */
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
  while (store->vault && vault_take_damaged(store->vault, name)) {
    object_kind kind;
    const char *id;
    metrics_quarantined();
    if (objects_read_name(name, &kind, &id) && store->heal) {
      store->heal(store->heal_user, kind, id);
    }
  }
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

/* A copy of an object in S3 that was fetched again has another hash: the mark is one of the copy. */
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

/* Moves the file aside if it still has the name: it may have been replaced, or moved by another thread, since it was
 * read. */
static store_result move_aside(const char *path, const char *aside, int fd, int *moved) {
  struct stat read, named;
  if (stat(path, &named) != 0 || fstat(fd, &read) != 0) {
    return STORE_NOT_FOUND;
  }
  if (read.st_ino != named.st_ino) {
    return STORE_OK;
  }
  *moved = rename(path, aside) == 0;
  return *moved ? STORE_NOT_FOUND : failed("rename to", aside);
}

void objects_on_quarantine(objects *store, void (*heal)(void *user, object_kind kind, const char *id), void *user) {
  store->heal = heal;
  store->heal_user = user;
}

store_result objects_quarantine(objects *store, object_kind kind, const char *id, int fd) {
  char path[PATH_MAX], aside[PATH_MAX], fields[160];
  if (store->remote.publish) {
    return STORE_NOT_FOUND; /* the daemon does it */
  }
  objects_path(store, kind, id, path);
  snprintf(aside, sizeof aside, "%s/quarantine", store->root);
  store_result result = make_folder(aside);
  int moved = 0;
  size_t n = strlen(aside);
  snprintf(aside + n, sizeof aside - n, "/%s-%s-%lld", folders[kind], id, (long long)time(NULL));
  if (result == STORE_OK && store->vault) {
    char name[OBJECT_NAME];
    objects_name(kind, id, name);
    result = vault_quarantine(store->vault, name, fd, aside);
    moved = result == STORE_NOT_FOUND;
  } else if (result == STORE_OK) {
    (void)objects_exclude(store); /* files: there are no other nodes */
    result = move_aside(path, aside, fd, &moved);
    objects_let_go(store);
  }
  if (moved) {
    metrics_quarantined();
    snprintf(fields, sizeof fields, "\"object\":\"%s\",\"id\":\"%s\"", folders[kind], id);
    log_write(LOG_ERROR, fields, "a stored file does not match its hash and was moved to %s", aside);
    if (store->heal) {
      store->heal(store->heal_user, kind, id);
    }
  }
  return result;
}

store_result objects_set_aside(objects *store, object_kind kind, const char *id) {
  char path[PATH_MAX], aside[PATH_MAX];
  objects_path(store, kind, id, path);
  snprintf(aside, sizeof aside, "%s/lost+found", store->root);
  store_result result = make_folder(aside);
  size_t n = strlen(aside);
  snprintf(aside + n, sizeof aside - n, "/%s-%s", folders[kind], id);
  if (result == STORE_OK && store->vault) {
    char name[OBJECT_NAME];
    objects_name(kind, id, name);
    result = vault_set_aside(store->vault, name, aside);
  } else if (result == STORE_OK && rename(path, aside) != 0) {
    result = failed("rename to", aside);
  }
  if (result == STORE_OK) {
    utimensat(AT_FDCWD, aside, NULL, 0); /* objects_purge_lost() counts from now */
  }
  return result;
}

long objects_purge_lost(objects *store, int64_t before) {
  char path[PATH_MAX];
  long purged = 0;
  snprintf(path, sizeof path, "%s/lost+found", store->root);
  DIR *dir = opendir(path);
  for (struct dirent *entry; dir && (entry = readdir(dir));) {
    struct stat info;
    if (entry->d_name[0] != '.' && fstatat(dirfd(dir), entry->d_name, &info, AT_SYMLINK_NOFOLLOW) == 0 &&
        S_ISREG(info.st_mode) && info.st_mtime < before) {
      purged += unlinkat(dirfd(dir), entry->d_name, 0) == 0;
    }
  }
  if (dir) {
    closedir(dir);
  }
  return purged;
}

int objects_is_read_only(const objects *store) {
  struct statvfs info;
  return !store->remote.publish && statvfs(store->root, &info) == 0 && (info.f_flag & ST_RDONLY);
}

uint64_t objects_free_bytes(const objects *store) {
  if (store->remote.publish) {
    return UINT64_MAX; /* the daemon looks */
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
  store_result result = STORE_OK;
  if (store->vault) {
    return vault_each(store->vault, visit, &(named_visit){each, user});
  }
  for (int kind = 0; kind < OBJECT_KINDS; kind++) {
    for (int shard = 0; shard < 256; shard++) {
      char path[PATH_MAX];
      snprintf(path, sizeof path, "%s/objects/%s/%02x", store->root, folders[kind], (unsigned)shard);
      DIR *dir = opendir(path); /* not there: no object in it so far */
      for (struct dirent *entry; dir && (entry = readdir(dir));) {
        struct stat info;
        if (entry->d_name[0] != '.' && fstatat(dirfd(dir), entry->d_name, &info, 0) == 0) {
          each(user, (object_kind)kind, entry->d_name, (uint64_t)info.st_size);
        }
      }
      if (dir) {
        closedir(dir);
      } else if (errno != ENOENT) {
        result = failed("open", path);
      }
    }
  }
  return result;
}
