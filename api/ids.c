#include "api/ids.h"

#include <string.h>

#include "api/sha256.h"

void api_hash_begin(api_hash *hash) {
  crypto_hash_sha256_init(&hash->state);
}
void api_hash_add(api_hash *hash, const void *bytes, size_t size) {
  api_sha256_add(&hash->state, bytes, size);
}
void api_hash_end(api_hash *hash, char out[API_ID_SIZE]) {
  unsigned char digest[crypto_hash_sha256_BYTES];
  crypto_hash_sha256_final(&hash->state, digest);
  sodium_bin2hex(out, API_ID_SIZE, digest, sizeof digest);
}

void api_id_of_text(const char *text, size_t size, char out[API_ID_SIZE]) {
  api_hash hash;
  api_hash_begin(&hash);
  api_hash_add(&hash, text, size);
  api_hash_end(&hash, out);
}

void api_mesh_id(const api_hash *bytes, const char *repair, const char *forced, char out[API_ID_SIZE]) {
  api_hash hash = *bytes;
  api_hash_add(&hash, "\0repair=", 8);
  api_hash_add(&hash, repair, strlen(repair));
  if (forced) {
    api_hash_add(&hash, "\0format=", 8);
    api_hash_add(&hash, forced, strlen(forced));
  }
  api_hash_end(&hash, out);
}

static int all_hex(const char *text, size_t size) {
  for (size_t i = 0; i < size; i++) {
    if (!((text[i] >= '0' && text[i] <= '9') || (text[i] >= 'a' && text[i] <= 'f'))) {
      return 0;
    }
  }
  return 1;
}

int api_id_valid(const char *text, size_t size) {
  return size == API_ID_SIZE - 1 && all_hex(text, size);
}

void api_random_id(char out[API_JOB_ID_SIZE]) {
  unsigned char bytes[16];
  randombytes_buf(bytes, sizeof bytes);
  sodium_bin2hex(out, API_JOB_ID_SIZE, bytes, sizeof bytes);
}

int api_job_id_valid(const char *text, size_t size) {
  return size == API_JOB_ID_SIZE - 1 && all_hex(text, size);
}
