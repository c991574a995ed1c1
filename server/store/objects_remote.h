/* The store of a process that has no files: temporary files lie in memory, and these functions take what is published
 * and give what is read. */
#ifndef ORB_STORE_OBJECTS_REMOTE_H
#define ORB_STORE_OBJECTS_REMOTE_H

#include <stdint.h>

#include "store/object_files.h"
#include "store/result.h"

typedef struct objects_remote {
  /* The caller keeps the descriptor. */
  store_result (*publish)(void *user, object_kind kind, const char *id, int fd);
  store_result (*read)(void *user, object_kind kind, const char *id, int *fd, uint64_t *size);
  void *user;
  int bucket; /* whether what is published goes to a bucket */
} objects_remote;

#endif
