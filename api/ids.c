#include "api/ids.h"

#include <string.h>

void orb_hash_begin(orb_hash *hash) {
  crypto_hash_sha256_init(&hash->state);
}
void orb_hash_add(orb_hash *hash, const void *bytes, size_t size) {
  crypto_hash_sha256_update(&hash->state, bytes, size);
}
void orb_hash_end(orb_hash *hash, char out[ORB_ID_SIZE]) {
  unsigned char digest[crypto_hash_sha256_BYTES];
  crypto_hash_sha256_final(&hash->state, digest);
  sodium_bin2hex(out, ORB_ID_SIZE, digest, sizeof digest);
}

void orb_id_of_text(const char *text, size_t size, char out[ORB_ID_SIZE]) {
  orb_hash hash;
  orb_hash_begin(&hash);
  orb_hash_add(&hash, text, size);
  orb_hash_end(&hash, out);
}

void orb_mesh_id(const orb_hash *bytes, const char *repair, const char *forced, char out[ORB_ID_SIZE]) {
  orb_hash hash = *bytes;
  orb_hash_add(&hash, "\0repair=", 8);
  orb_hash_add(&hash, repair, strlen(repair));
  if (forced) {
    orb_hash_add(&hash, "\0format=", 8);
    orb_hash_add(&hash, forced, strlen(forced));
  }
  orb_hash_end(&hash, out);
}

static int all_hex(const char *text, size_t size) {
  for (size_t i = 0; i < size; i++) {
    if (!((text[i] >= '0' && text[i] <= '9') || (text[i] >= 'a' && text[i] <= 'f'))) {
      return 0;
    }
  }
  return 1;
}

int orb_id_valid(const char *text, size_t size) {
  return size == ORB_ID_SIZE - 1 && all_hex(text, size);
}

void orb_random_id(char out[ORB_JOB_ID_SIZE]) {
  unsigned char bytes[16];
  randombytes_buf(bytes, sizeof bytes);
  sodium_bin2hex(out, ORB_JOB_ID_SIZE, bytes, sizeof bytes);
}

int orb_job_id_valid(const char *text, size_t size) {
  return size == ORB_JOB_ID_SIZE - 1 && all_hex(text, size);
}
