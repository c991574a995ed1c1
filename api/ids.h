/* Identity: SHA-256 over canonical bytes, lower-case hex. */
#ifndef ORB_API_IDS_H
#define ORB_API_IDS_H

#include <sodium.h>
#include <stddef.h>

enum { ORB_ID_SIZE = 65 };

/* A hash that grows with the upload. */
typedef struct orb_hash {
  crypto_hash_sha256_state state;
} orb_hash;
void orb_hash_begin(orb_hash *hash);
void orb_hash_add(orb_hash *hash, const void *bytes, size_t size);
void orb_hash_end(orb_hash *hash, char out[ORB_ID_SIZE]);

/* The id of a text, for example of a canonical request. */
void orb_id_of_text(const char *text, size_t size, char out[ORB_ID_SIZE]);

/* The id of a mesh: the hash of the uploaded bytes, finished with the canonical repair options. forced: the format
 * that the caller named where the bytes alone do not tell, or NULL. */
void orb_mesh_id(const orb_hash *bytes, const char *repair, const char *forced, char out[ORB_ID_SIZE]);

/* True for 64 lower-case hex digits and nothing else. */
int orb_id_valid(const char *text, size_t size);

/* A random id of a job: 32 hex digits. */
enum { ORB_JOB_ID_SIZE = 33 };
void orb_random_id(char out[ORB_JOB_ID_SIZE]);
int orb_job_id_valid(const char *text, size_t size);

#endif
