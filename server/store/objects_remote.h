/* The store of a process that has no files but one in memory: objects are written into it one after another, and these
 * functions take what is published and give what is read. What is written stays charged, as the process does not know
 * when the reader has freed it. */
#ifndef ORB_STORE_OBJECTS_REMOTE_H
#define ORB_STORE_OBJECTS_REMOTE_H

#include <stdint.h>

#include "orbmorph/context.h"
#include "store/object_files.h"
#include "store/result.h"

typedef struct objects_remote {
  /* The object is so many bytes of the file from `start` on. */
  store_result (*publish)(void *user, object_kind kind, const char *id, int64_t start, int64_t size);
  store_result (*read)(void *user, object_kind kind, const char *id, int *fd, uint64_t *size);
  void *user;
  orb_context *ctx; /* in whose budget the bytes count that are written: STORE_FULL with its error beyond it */
  int file;         /* −1: nothing can be written */
  int bucket;       /* whether what is published goes to a bucket */
} objects_remote;

#endif
