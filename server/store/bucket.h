/* Objects in a bucket of S3. Each has the SHA-256 of its bytes as metadata, and every read is compared with it.
 *
 * While S3 does not answer, or refuses, every call fails at once with STORE_AWAY, and a thread asks once a second
 * whether it answers again. A bucket belongs to one deployment: an object of its prefix names it. Any thread may call
 * any function.
 */
#ifndef ORB_STORE_BUCKET_H
#define ORB_STORE_BUCKET_H

#include "store/result.h"
#include "store/s3.h"

enum { BUCKET_OWNER = 64, BUCKET_LINK = 8192 };

typedef struct object_bucket object_bucket;

typedef struct bucket_options {
  const char *url;         /* see net/s3_url.h */
  const char *keys;        /* a file of keys, in the format of the AWS tools; "": the environment */
  const char *authorities; /* PEM file; "": those of the system */
} bucket_options;

/* Reads the owner of the bucket's prefix; "": it has none yet. Writes nothing. STORE_UNFIT: no bucket, or its keys are
 * wrong; STORE_AWAY: no answer. Both are logged. */
store_result bucket_open(const bucket_options *options, char owner[BUCKET_OWNER + 1], object_bucket **out);
void bucket_close(object_bucket *b);
store_result bucket_owner(object_bucket *b, char owner[BUCKET_OWNER + 1]); /* reads it again; results as above */
/* Whether the keys may write: begins an upload in parts and aborts it, which writes nothing. STORE_UNFIT: they may not;
 * logged. */
store_result bucket_check_writes(object_bucket *b);
/* Makes the prefix belong to `owner`. STORE_UNFIT: another deployment has claimed it; logged. */
store_result bucket_claim(object_bucket *b, const char *owner);

/* Uploads a whole file. */
store_result bucket_put(object_bucket *b, const char *name, int fd);
/* Writes an object to an empty file. STORE_CONFLICT: its bytes do not match their hash, also after some tries;
 * STORE_ERROR: S3 did not send a hash, logged. */
store_result bucket_get(object_bucket *b, const char *name, int fd, uint64_t *size);
/* sha: of the object as it was uploaded; modified: when, a Unix time. Either may be NULL. */
store_result bucket_look(object_bucket *b, const char *name, char sha[65], int64_t *modified);
/* Also STORE_OK if there is no such object. signed_at: 0, or a time of bucket_clock(): S3 refuses the request when more
 * than BUCKET_DELETE_S have passed since then (STORE_CONFLICT), however long this process or its request was held up.
 */
enum { BUCKET_DELETE_S = 5 };
store_result bucket_delete(object_bucket *b, const char *name, int64_t signed_at);
int64_t bucket_clock(object_bucket *b); /* see s3_clock() */
/* Calls `each` for every object but the owner's. */
store_result bucket_each(object_bucket *b, void (*each)(void *user, const char *name, uint64_t size), void *user);
/* See s3_link(). */
int bucket_link(object_bucket *b, const char *name, long seconds, const char *more, char out[BUCKET_LINK]);

int bucket_is_away(object_bucket *b);
/* Whether S3 was unreachable at some time since `since` (orb_clock_ms()). */
int bucket_was_away(object_bucket *b, int64_t since);
/* SHA-256 of a file's bytes, in hexadecimal digits. 0: it cannot be read. */
int bucket_hash(int fd, uint64_t from, uint64_t size, char out[65]);

#endif
