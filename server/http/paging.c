/* A permutation of 64 bits: a Feistel network of four rounds (Luby and Rackoff 1988) with SipHash-2-4 as its round
 * function. */
#include "http/paging.h"

#include <sodium.h>
#include <string.h>

enum { ROUNDS = 4 };
_Static_assert(CATALOGUE_SECRET == crypto_shorthash_KEYBYTES, "the secret is a key of the hash");

/* Sequence numbers are below this; a token that decrypts to any other number was never issued. */
static const int64_t NUMBERS = (int64_t)1 << 40;

static uint32_t scramble(const unsigned char *key, int round, uint32_t half) {
  unsigned char in[5] = {(unsigned char)round}, out[crypto_shorthash_BYTES];
  uint32_t mixed;
  memcpy(in + 1, &half, sizeof half);
  crypto_shorthash(out, in, sizeof in, key);
  memcpy(&mixed, out, sizeof mixed);
  return mixed;
}

uint64_t paging_seal(const unsigned char key[CATALOGUE_SECRET], int64_t number) {
  uint32_t left = (uint32_t)((uint64_t)number >> 32), right = (uint32_t)number;
  for (int i = 0; i < ROUNDS; i++) {
    uint32_t next = left ^ scramble(key, i, right);
    left = right;
    right = next;
  }
  return (uint64_t)left << 32 | right;
}

int64_t paging_open(const unsigned char key[CATALOGUE_SECRET], uint64_t token) {
  uint32_t left = (uint32_t)(token >> 32), right = (uint32_t)token;
  for (int i = ROUNDS - 1; i >= 0; i--) {
    uint32_t before = right ^ scramble(key, i, left);
    right = left;
    left = before;
  }
  int64_t number = (int64_t)((uint64_t)left << 32 | right);
  return number > 0 && number < NUMBERS ? number : 0;
}
