/* Object files: written once under their id, never changed.
 *
 * Contract. A writer fills a temporary file and publishes it: fsync of the file, rename to its place, fsync of the
 * folder. So an object is there whole or not at all, also after a crash. Temporary files live in one folder of the
 * same file system; what a dead process left there is swept at start. All functions may be called from any thread;
 * publishing the same id twice is fine, for equal ids have equal bytes.
 */
#ifndef ORB_STORE_OBJECTS_H
#define ORB_STORE_OBJECTS_H

#include <limits.h>
#include <stddef.h>
#include <stdint.h>

typedef enum object_kind {
  OBJECT_MESH,
  OBJECT_SPHERE,
  OBJECT_ASSET,
  OBJECT_PLACES,
  OBJECT_SPHERES, /* of a supermesh: see worker/spheres.h */
  OBJECT_KINDS
} object_kind;

/* What the store can say of a call. */
typedef enum store_result {
  STORE_OK = 0,
  STORE_NOT_FOUND,
  STORE_CONFLICT, /* a condition does not hold any more */
  STORE_FULL,     /* no space left */
  STORE_ERROR,    /* input/output error; logged */
} store_result;

typedef struct objects objects;

/* Makes the folders under data and sweeps temporary files. */
store_result objects_open(const char *data, objects **out);
void objects_close(objects *store);

typedef struct object_temp {
  int fd; /* −1: none */
  char name[16];
  const objects *store; /* small: each request holds one of these */
} object_temp;

store_result objects_begin(objects *store, object_temp *temp);
/* Appends all bytes. */
store_result objects_append(object_temp *temp, const void *bytes, size_t size);
/* Makes it the object; the temporary file is gone afterwards, whatever the result. */
store_result objects_publish(objects *store, object_temp *temp, object_kind kind, const char *id);
/* Closes and removes what was begun; fine on one that was published. */
void objects_abandon(object_temp *temp);
/* All at once. */
store_result objects_put(objects *store, object_kind kind, const char *id, const void *bytes, size_t size);

/* An object without a row is harmless, a row without its object is not. So who publishes objects and then commits
 * their row holds meanwhile, any number side by side; who removes a row and then its objects excludes all of them. Both
 * let go, on the thread that began. */
void objects_hold(objects *store);
void objects_exclude(objects *store);
void objects_let_go(objects *store);

/* A descriptor to read it, and its size. */
store_result objects_read(const objects *store, object_kind kind, const char *id, int *fd, uint64_t *size);
/* Its bytes, in memory of malloc(). */
store_result objects_load(const objects *store, object_kind kind, const char *id, unsigned char **bytes, size_t *size);
store_result objects_delete(const objects *store, object_kind kind, const char *id);

/* Free bytes of the file system; for the reserve. */
uint64_t objects_free_bytes(const objects *store);

/* Calls back for every object that lies there. STORE_ERROR where a folder could not be read; the others were. */
store_result objects_each(const objects *store,
                          void (*each)(void *user, object_kind kind, const char *id, uint64_t size), void *user);

#endif
