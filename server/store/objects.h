/* Objects: bytes named by an id, written once and never changed: in files of the data folder, or in a bucket of S3.
 *
 * Contract of files. A writer fills a temporary file and publishes it: fsync of the file, rename to its final path,
 * fsync of the folder. So an object exists completely or not at all, also after a crash. Temporary files live in one
 * folder of the same file system; objects_open() deletes those of a dead process. Any thread may call any function.
 * Publishing the same id twice is allowed, because equal ids have equal bytes.
 *
 * In a bucket, an object has its final name from the start, and S3 shows it completely or not at all. The folder
 * `cache` of the data folder then has verified copies of the objects that were used last, so a descriptor always refers
 * to a file.
 */
#ifndef ORB_STORE_OBJECTS_H
#define ORB_STORE_OBJECTS_H

#include <limits.h>
#include <stddef.h>
#include <stdint.h>

#include "orbmorph/context.h"
#include "store/bucket.h"
#include "store/object_files.h"
#include "store/objects_remote.h"
#include "store/result.h"

typedef struct objects objects;

/* Creates the folders under data and deletes temporary files. */
store_result objects_open(const char *data, objects **out);
/* The same for objects in a bucket, which belongs to the store from now on. most: bytes of the folder `cache`. */
store_result objects_open_bucket(const char *data, object_bucket *b, uint64_t most, objects **out);
/* Opens the store for reading only, and changes nothing. */
store_result objects_open_read_only(const char *data, objects **out);

/* A store for a process that has no files. */
store_result objects_open_remote(const objects_remote *remote, objects **out);
void objects_close(objects *store);

typedef struct object_temp {
  int fd;        /* −1: none */
  int64_t start; /* in the file of a process without others */
  char name[16];
  const objects *store;
} object_temp;

/* A process without other files has one at a time. */
store_result objects_begin(objects *store, object_temp *temp);
/* Appends all bytes. */
store_result objects_append(object_temp *temp, const void *bytes, size_t size);
/* Turns the temporary file into the object. The temporary file no longer exists afterwards, even on failure. */
store_result objects_publish(objects *store, object_temp *temp, object_kind kind, const char *id);
/* Closes and deletes the temporary file; does nothing after objects_publish(). */
void objects_abandon(object_temp *temp);
/* Begins, appends and publishes. */
store_result objects_put(objects *store, object_kind kind, const char *id, const void *bytes, size_t size);

/* An object without a row is harmless; a row without its object is damage. So a thread that publishes objects and then
 * commits their row calls objects_hold() first; any number of threads may hold at once. A thread that deletes a row and
 * then its objects calls objects_exclude() first, which waits for all holders. The same thread calls objects_let_go()
 * afterwards. Among nodes, the hold may be lost with a connection: then the commit of the row fails with STORE_LOST. */
void objects_hold(objects *store);
/* After STORE_LOST: takes the hold again. Objects that were published before may be gone; objects_look() tells. */
void objects_hold_again(objects *store);
/* 0: nodes that share the bucket could not be excluded; nothing may be deleted. */
int objects_exclude(objects *store);
void objects_let_go(objects *store);
/* Tells the store that other nodes share its bucket through this lock. The store closes the lock. */
struct object_lock;
void objects_share(objects *store, struct object_lock *lock);

/* Begins, and appends so many bytes of a file from `start` on, in parts: a process that made the file could still write
 * to it. STORE_ERROR if it has fewer. Ends when the context is cancelled or reaches its deadline. */
store_result objects_copy(objects *store, orb_context *ctx, int from, int64_t start, int64_t size, object_temp *temp);

/* Opens an object for reading; the caller closes *fd. */
store_result objects_read(const objects *store, object_kind kind, const char *id, int *fd, uint64_t *size);
/* Reads a whole object into memory allocated with malloc(). */
store_result objects_load(const objects *store, object_kind kind, const char *id, unsigned char **bytes, size_t *size);
/* Whether an object is there, without reading it. */
store_result objects_look(const objects *store, object_kind kind, const char *id);
/* Whether the object can be read now without asking another machine. */
int objects_is_near(const objects *store, object_kind kind, const char *id);
/* Whether the objects are in a bucket, and whether the bucket fails to answer. */
int objects_are_remote(const objects *store);
int objects_go_to_bucket(const objects *store); /* as the first, also for the store of a process without files */
int objects_are_away(const objects *store);
/* Whether it has failed to answer at some time since `since` (orb_clock_ms()). */
int objects_were_away(const objects *store, int64_t since);
/* A URL from which anyone may read an object for so many seconds; more: see s3_presign(). 0: there is none. */
int objects_link(const objects *store, object_kind kind, const char *id, long seconds, const char *more,
                 char out[BUCKET_LINK]);
/* The name of an object in a bucket. */
enum { OBJECT_NAME = 100 };
void objects_name(object_kind kind, const char *id, char out[OBJECT_NAME]);
/* id: points into the name. 0: the name is not that of an object. */
int objects_read_name(const char *name, object_kind *kind, const char **id);
/* The path of an object's file, which may not exist. */
void objects_path(const objects *store, object_kind kind, const char *id, char out[PATH_MAX]);

/* Opens the lock file of backups. A backup holds it exclusively (flock()), so the kernel releases it with the process;
 * a thread that deletes an object shares it for that moment. −1 with the reason logged. */
int objects_backup_lock(const char *data);
/* For store/verify.h: marks of verified objects, in memory. */
void objects_mark(objects *store, object_kind kind, const char *id);
int objects_is_marked(const objects *store, object_kind kind, const char *id);
/* Whether the file system is mounted read-only, as the kernel does after errors of the disk. */
int objects_is_read_only(const objects *store);
/* Free bytes of the file system, for disk-reserve. */
uint64_t objects_free_bytes(const objects *store);

/* Calls `each` for every object. STORE_ERROR if a folder could not be read; all others were. */
store_result objects_each(const objects *store,
                          void (*each)(void *user, object_kind kind, const char *id, uint64_t size), void *user);

#endif
