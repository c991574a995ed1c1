/* Ids: SHA-256 of canonical bytes, in lower-case hexadecimal. */
#ifndef ORB_API_IDS_H
#define ORB_API_IDS_H

#include <sodium.h>
#include <stddef.h>

enum { API_ID_SIZE = 65 };

/* A hash that is updated as an upload arrives. */
typedef struct api_hash {
  crypto_hash_sha256_state state;
} api_hash;
void api_hash_begin(api_hash *hash);
void api_hash_add(api_hash *hash, const void *bytes, size_t size);
void api_hash_end(api_hash *hash, char out[API_ID_SIZE]);

/* Writes the id of a text, such as a canonical request. */
void api_id_of_text(const char *text, size_t size, char out[API_ID_SIZE]);

/* Writes the id of a mesh: the hash of the uploaded bytes followed by the canonical repair list. forced: the format
 * that the request names because the bytes do not determine it, or NULL. */
void api_mesh_id(const api_hash *bytes, const char *repair, const char *forced, char out[API_ID_SIZE]);

/* True for exactly 64 lower-case hexadecimal digits. */
int api_id_valid(const char *text, size_t size);

/* Job ids are random: 32 lower-case hexadecimal digits. */
enum { API_JOB_ID_SIZE = 33 };
void api_random_id(char out[API_JOB_ID_SIZE]);
int api_job_id_valid(const char *text, size_t size);

#endif
