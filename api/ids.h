/* Identity: SHA-256 over canonical bytes, lower-case hex. */
#ifndef ORB_API_IDS_H
#define ORB_API_IDS_H

#include <sodium.h>
#include <stddef.h>

enum { API_ID_SIZE = 65 };

/* A hash that grows with the upload. */
typedef struct api_hash {
  crypto_hash_sha256_state state;
} api_hash;
void api_hash_begin(api_hash *hash);
void api_hash_add(api_hash *hash, const void *bytes, size_t size);
void api_hash_end(api_hash *hash, char out[API_ID_SIZE]);

/* The id of a text, for example of a canonical request. */
void api_id_of_text(const char *text, size_t size, char out[API_ID_SIZE]);

/* The id of a mesh: the hash of the uploaded bytes, finished with the canonical repair options. forced: the format
 * that the caller named where the bytes alone do not tell, or NULL. */
void api_mesh_id(const api_hash *bytes, const char *repair, const char *forced, char out[API_ID_SIZE]);

/* True for 64 lower-case hex digits and nothing else. */
int api_id_valid(const char *text, size_t size);

/* A random id of a job: 32 hex digits. */
enum { API_JOB_ID_SIZE = 33 };
void api_random_id(char out[API_JOB_ID_SIZE]);
int api_job_id_valid(const char *text, size_t size);

#endif
