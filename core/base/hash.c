/* SipHash (Aumasson and Bernstein 2012) with one round a word and three at the end. */
#include "base/hash.h"

#include <string.h>
#include <unistd.h>
#if defined(__APPLE__)
#include <sys/random.h>
#endif

#include "base/state.h"

typedef struct sip_state {
  uint64_t v[4];
} sip_state;

static inline uint64_t turn(uint64_t x, int bits) {
  return x << bits | x >> (64 - bits);
}

static inline void sip_round(sip_state *s) {
  uint64_t *v = s->v;
  v[0] += v[1];
  v[1] = turn(v[1], 13) ^ v[0];
  v[0] = turn(v[0], 32);
  v[2] += v[3];
  v[3] = turn(v[3], 16) ^ v[2];
  v[0] += v[3];
  v[3] = turn(v[3], 21) ^ v[0];
  v[2] += v[1];
  v[1] = turn(v[1], 17) ^ v[2];
  v[2] = turn(v[2], 32);
}

static inline void sip_word(sip_state *s, uint64_t word) {
  s->v[3] ^= word;
  sip_round(s);
  s->v[0] ^= word;
}

uint64_t orb_siphash13(const uint64_t key[2], const void *bytes, size_t size) {
  const unsigned char *at = bytes;
  sip_state s = {{key[0] ^ 0x736f6d6570736575u, key[1] ^ 0x646f72616e646f6du, key[0] ^ 0x6c7967656e657261u,
                  key[1] ^ 0x7465646279746573u}};
  uint64_t last = (uint64_t)(size & 0xff) << 56;
  for (size_t left = size; left >= 8; left -= 8, at += 8) {
    uint64_t word;
    memcpy(&word, at, sizeof word);
    sip_word(&s, word);
  }
  for (size_t i = 0; i < (size & 7); i++) {
    last |= (uint64_t)at[i] << (8 * i);
  }
  sip_word(&s, last);
  s.v[2] ^= 0xff;
  for (int i = 0; i < 3; i++) {
    sip_round(&s);
  }
  return s.v[0] ^ s.v[1] ^ s.v[2] ^ s.v[3];
}

uint64_t orb_hash(const orb_context *ctx, const void *bytes, size_t size) {
  return orb_siphash13(ctx->hash_key, bytes, size);
}

void orb_hash_key(uint64_t key[2]) {
  if (getentropy(key, 2 * sizeof *key) !=
      0) { /* a kernel before 3.17: addresses and the clock are hard to guess, too */
    key[0] = (uint64_t)(uintptr_t)key ^ (uint64_t)(orb_clock() * 1e9);
    key[1] = key[0] * 0x9e3779b97f4a7c15u ^ (uint64_t)(uintptr_t)&orb_hash_key;
  }
}
