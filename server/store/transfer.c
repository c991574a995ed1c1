#include "store/transfer.h"

#include <errno.h>
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
  struct stat info; /* of the source */
  const char *id;
  const named_object *object;
  int64_t reserve; /* bytes that stay free where the copy goes */
} transfer;

/* Reads a file of the source's size once: hashes it, and appends it to `copy` unless that is NULL. */
static store_result read_file(const transfer *t, int fd, object_temp *copy, char sha[API_ID_SIZE]) {
  unsigned char digest[crypto_hash_sha256_BYTES], *block = malloc(BLOCK);
  crypto_hash_sha256_state state;
  store_result result = block ? STORE_OK : STORE_ERROR;
  crypto_hash_sha256_init(&state);
  for (off_t at = 0; result == STORE_OK && at < t->info.st_size;) {
    ssize_t n = pread(fd, block, BLOCK, at);
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

/* STORE_CONFLICT: the object in this file has another hash than it should have. sha: of the file. */
static store_result compare(const transfer *t, int fd, const char *sha) {
  if (t->object->kind == OBJECT_SPHERES) { /* the file itself has its hash */
    return spheres_check_file(fd, (uint64_t)t->info.st_size);
  }
  return !t->object->sha[0] || strcmp(sha, t->object->sha) == 0 ? STORE_OK : STORE_CONFLICT;
}

static int has_size_and_time(const transfer *t, const struct stat *there) {
  return there->st_size == t->info.st_size && there->st_mtim.tv_sec == t->info.st_mtim.tv_sec &&
         there->st_mtim.tv_nsec == t->info.st_mtim.tv_nsec;
}

/* Whether the same file has a name in both stores, as backups of an earlier version made it. */
static int is_link(const transfer *t, const struct stat *there) {
  return there->st_ino == t->info.st_ino && there->st_dev == t->info.st_dev;
}

/* What has to be done. A copy that would stay is read, because no one else reads the objects of a backup: damage of its
 * disk can be mended only as long as the source has the object. */
static transfer_deed find_deed(const transfer *t, const objects *to) {
  int fd;
  uint64_t size;
  char sha[API_ID_SIZE];
  struct stat there;
  transfer_deed deed = TRANSFER_NEW;
  if (objects_read(to, t->object->kind, t->id, &fd, &size) != STORE_OK) {
    return deed;
  }
  if (fstat(fd, &there) == 0 && !is_link(t, &there) && has_size_and_time(t, &there)) {
    deed = read_file(t, fd, NULL, sha) == STORE_OK && compare(t, fd, sha) == STORE_OK ? TRANSFER_NONE : TRANSFER_MENDED;
  }
  close(fd);
  return deed;
}

static store_result copy_to(const transfer *t, objects *to) {
  object_temp copy;
  char sha[API_ID_SIZE];
  const struct timespec times[2] = {t->info.st_atim, t->info.st_mtim};
  if ((uint64_t)t->reserve + (uint64_t)t->info.st_size > objects_free_bytes(to)) {
    return STORE_FULL;
  }
  store_result result = objects_begin(to, &copy);
  if (result == STORE_OK) {
    result = read_file(t, t->source, &copy, sha);
    if (result == STORE_OK) {
      result = compare(t, t->source, sha);
    }
    if (result == STORE_OK) {
      futimens(copy.fd, times); /* by which the next backup recognises it */
      result = objects_publish(to, &copy, t->object->kind, t->id);
    }
    objects_abandon(&copy);
  }
  return result;
}

store_result transfer_object(const objects *from, objects *to, const char *id, const named_object *object,
                             int64_t reserve, transfer_deed *deed) {
  transfer t = {.id = id, .object = object, .reserve = reserve};
  uint64_t size;
  *deed = TRANSFER_NONE;
  store_result result = objects_read(from, object->kind, id, &t.source, &size);
  if (result != STORE_OK) {
    return result;
  }
  if (fstat(t.source, &t.info) != 0) {
    result = STORE_ERROR;
  } else {
    const transfer_deed needed = find_deed(&t, to);
    if (needed != TRANSFER_NONE) {
      FAULT_POINT("transfer");
      result = copy_to(&t, to);
      *deed = result == STORE_OK ? needed : TRANSFER_NONE;
    }
  }
  close(t.source);
  return result;
}
