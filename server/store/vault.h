/* A bucket, and a folder that caches verified copies of its objects: what store/objects.h needs of S3. Names are paths
 * in both, such as mesh/ab/abcd…. Any thread may call any function. */
#ifndef ORB_STORE_VAULT_H
#define ORB_STORE_VAULT_H

#include "store/bucket.h"

enum { VAULT_NAME = 100, VAULT_GRACE_S = 3600 };

typedef struct vault vault;

/* data: the data folder, in which `cache` is made. The bucket belongs to the vault from now on. NULL: it cannot be
 * made; logged. */
vault *vault_open(const char *data, object_bucket *b, uint64_t most);
void vault_close(vault *v);

/* Uploads a file of the data folder, and moves it to the cache. The file no longer exists afterwards, even on failure.
 */
store_result vault_publish(vault *v, const char *name, int fd, const char *path);
/* Opens the copy, which is fetched if it is not there. STORE_NOT_FOUND also for what does not match its hash: it goes
 * to the folder `quarantine`, see vault_take_damaged(). */
store_result vault_read(vault *v, const char *name, int *fd, uint64_t *size);
/* Asks the bucket, not the cache. */
store_result vault_look(vault *v, const char *name);
/* See bucket_delete(). */
store_result vault_delete(vault *v, const char *name, int64_t signed_at);
int64_t vault_clock(vault *v);
/* Calls `each` for every object of the bucket. */
store_result vault_each(vault *v, void (*each)(void *user, const char *name, uint64_t size), void *user);

/* A number of the copy that is in the cache now; 0: there is none. Another copy has another number. */
uint64_t vault_copy(const vault *v, const char *name);
/* Moves a copy aside that was read through fd and does not match its row. STORE_NOT_FOUND: the object in the
 * bucket was the same, and is deleted; STORE_OK: the bucket has another one. */
store_result vault_quarantine(vault *v, const char *name, int fd, const char *aside, int64_t signed_at);
/* Moves an object out of the bucket to a path, for --gc. STORE_CONFLICT: it is younger than VAULT_GRACE_S, so its row
 * may still come. */
store_result vault_set_aside(vault *v, const char *name, const char *aside, int64_t signed_at);
/* Takes the name of one object that vault_read() found damaged. 0: there is none. */
int vault_take_damaged(vault *v, char name[VAULT_NAME]);
/* Deletes that object from the bucket if it is still damaged. STORE_NOT_FOUND: done; STORE_OK: it has been replaced. */
store_result vault_drop_damaged(vault *v, const char *name, int64_t signed_at);

int vault_is_away(vault *v);
int vault_was_away(vault *v, int64_t since);
int vault_link(vault *v, const char *name, long seconds, const char *more, char out[BUCKET_LINK]);

#endif
