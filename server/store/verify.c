#include "store/verify.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "api/ids.h"
#include "store/object_removal.h"
#include "store/spheres.h"

int verify_is_done(const objects *store, object_kind kind, const char *id) {
  return objects_is_marked(store, kind, id);
}

static int hash_file(int fd, char sha[API_ID_SIZE], const verify_pace *pace) {
  enum { BLOCK = 1 << 18 };
  unsigned char *block = malloc(BLOCK);
  api_hash hash;
  ssize_t n = block ? 1 : -1;
  api_hash_begin(&hash);
  for (off_t at = 0; n > 0; at += n) {
    do {
      n = pread(fd, block, BLOCK, at);
    } while (n < 0 && errno == EINTR);
    if (n > 0) {
      api_hash_add(&hash, block, (size_t)n);
      if (pace && !pace->wait(pace->user, n)) {
        n = -1;
      }
    }
  }
  api_hash_end(&hash, sha);
  free(block);
  return n == 0;
}

int verify_hash(int fd, char sha[API_ID_SIZE]) {
  return hash_file(fd, sha, NULL);
}

store_result verify_slowly(objects *store, object_kind kind, const char *id, const char *sha, const verify_pace *pace) {
  int fd, wrong;
  uint64_t size;
  char found[API_ID_SIZE];
  store_result result = objects_read(store, kind, id, &fd, &size);
  if (result != STORE_OK) {
    return result;
  }
  if (kind == OBJECT_SPHERES) {
    result = spheres_check(store, id);
    wrong = result == STORE_CONFLICT;
    if (pace) {
      pace->wait(pace->user, (int64_t)size);
    }
    if (result != STORE_OK && !wrong) {
      close(fd);
      return result;
    }
  } else if (hash_file(fd, found, pace)) {
    wrong = sha[0] && strcmp(found, sha) != 0;
  } else {
    close(fd);
    return STORE_ERROR;
  }
  if (wrong) {
    result = objects_quarantine(store, kind, id, fd);
  } else {
    objects_mark(store, kind, id);
  }
  close(fd);
  return result;
}

store_result verify_again(objects *store, object_kind kind, const char *id, const char *sha) {
  return verify_slowly(store, kind, id, sha, NULL);
}

store_result verify_once(objects *store, object_kind kind, const char *id, const char *sha) {
  return objects_is_marked(store, kind, id) ? STORE_OK : verify_again(store, kind, id, sha);
}
