#include "hash.h"

#include <pthread.h>
#include <sodium.h>
#include <string.h>

static unsigned char key[crypto_shorthash_KEYBYTES];
_Static_assert(crypto_shorthash_BYTES == sizeof(uint64_t), "SipHash-2-4 has 64 bits");

static void make_key(void) {
  crypto_shorthash_keygen(key);
}

uint64_t keyed_hash(const void *bytes, size_t size) {
  static pthread_once_t once = PTHREAD_ONCE_INIT;
  uint64_t hash;
  pthread_once(&once, make_key);
  crypto_shorthash((unsigned char *)&hash, bytes, size, key);
  return hash;
}

uint64_t tenant_hash(const char *tenant) {
  return keyed_hash(tenant, strlen(tenant)) | HASH_OF_OWNER;
}
