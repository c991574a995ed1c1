#include "store/transfer.h"

#include <errno.h>
#include <fcntl.h>
#include <sodium.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "faults.h"
#include "log.h"
#include "store/spheres.h"

enum { BLOCK = 1 << 20 };

/* What transfer_object() works on. */
typedef struct transfer {
  int source;
  struct stat info;    /* of the source */
  char path[PATH_MAX]; /* of the object in `to` */
  const char *id;
  const named_object *object;
} transfer;

static int is_there(const transfer *t) {
  struct stat there;
  return stat(t->path, &there) == 0 &&
         ((there.st_ino == t->info.st_ino && there.st_dev == t->info.st_dev) ||
          (there.st_size == t->info.st_size && there.st_mtim.tv_sec == t->info.st_mtim.tv_sec &&
           there.st_mtim.tv_nsec == t->info.st_mtim.tv_nsec));
}

/* Reads the source once: hashes it, and appends it to `copy` unless that is NULL. */
static store_result read_source(const transfer *t, object_temp *copy, char sha[API_ID_SIZE]) {
  unsigned char digest[crypto_hash_sha256_BYTES], *block = malloc(BLOCK);
  crypto_hash_sha256_state state;
  store_result result = block ? STORE_OK : STORE_ERROR;
  crypto_hash_sha256_init(&state);
  for (off_t at = 0; result == STORE_OK && at < t->info.st_size;) {
    ssize_t n = pread(t->source, block, BLOCK, at);
    if (n < 0 && errno == EINTR) {
      continue;
    }
    if (n <= 0) {
      log_error("object %s cannot be read: %s", t->id, n < 0 ? strerror(errno) : "it is too short");
      result = STORE_CONFLICT;
      break;
    }
    crypto_hash_sha256_update(&state, block, (unsigned long long)n);
    at += n;
    if (copy) {
      result = objects_append(copy, block, (size_t)n);
    }
  }
  crypto_hash_sha256_final(&state, digest);
  sodium_bin2hex(sha, API_ID_SIZE, digest, sizeof digest);
  free(block);
  return result;
}

/* STORE_CONFLICT: the object has another hash than it should have. */
static store_result compare(const transfer *t, const objects *from, const char *sha) {
  if (t->object->kind == OBJECT_SPHERES) { /* the file itself has its hash */
    return spheres_check(from, t->id);
  }
  return !t->object->sha[0] || strcmp(sha, t->object->sha) == 0 ? STORE_OK : STORE_CONFLICT;
}

/* 1: linked; 0: the file systems do not allow it, or it failed. Deletes a name that a killed backup has left. */
static int link_to(const transfer *t, const objects *to) {
  char source[64], temp[PATH_MAX];
  snprintf(source, sizeof source, "/proc/self/fd/%d",
           t->source); /* the file that was read, even if another one has its name now */
  if (snprintf(temp, sizeof temp, "%s.new", t->path) >= (int)sizeof temp) {
    return 0;
  }
  unlink(temp);
  if (linkat(AT_FDCWD, source, AT_FDCWD, temp, AT_SYMLINK_FOLLOW) != 0 &&
      (errno != ENOENT || objects_make_folder(to, t->object->kind, t->id) != STORE_OK ||
       linkat(AT_FDCWD, source, AT_FDCWD, temp, AT_SYMLINK_FOLLOW) != 0)) {
    return 0;
  }
  if (rename(temp, t->path) == 0) {
    return 1;
  }
  unlink(temp);
  return 0;
}

static store_result copy_to(const transfer *t, const objects *from, objects *to) {
  object_temp copy;
  char sha[API_ID_SIZE];
  const struct timespec times[2] = {t->info.st_atim, t->info.st_mtim};
  store_result result = objects_begin(to, &copy);
  if (result == STORE_OK) {
    result = read_source(t, &copy, sha);
    if (result == STORE_OK) {
      result = compare(t, from, sha);
    }
    if (result == STORE_OK) {
      futimens(copy.fd, times); /* by which the next backup recognises it */
      result = objects_publish(to, &copy, t->object->kind, t->id);
    }
    objects_abandon(&copy);
  }
  return result;
}

store_result transfer_object(const objects *from, objects *to, const char *id, const named_object *object, int links,
                             int *made) {
  transfer t = {.id = id, .object = object};
  char sha[API_ID_SIZE];
  uint64_t size;
  *made = 0;
  store_result result = objects_read(from, object->kind, id, &t.source, &size);
  if (result != STORE_OK) {
    return result;
  }
  objects_path(to, object->kind, id, t.path);
  if (fstat(t.source, &t.info) != 0) {
    result = STORE_ERROR;
  } else if (!is_there(&t)) {
    FAULT_POINT("transfer");
    result = links ? read_source(&t, NULL, sha) : STORE_OK;
    if (result == STORE_OK && links) {
      result = compare(&t, from, sha);
    }
    if (result == STORE_OK && !(links && link_to(&t, to))) {
      result = copy_to(&t, from, to);
    }
    *made = result == STORE_OK;
  }
  close(t.source);
  return result;
}
