#include "api/sha256.h"

#if defined(__x86_64__)

#include <cpuid.h>
#include <immintrin.h>

enum { BLOCK = 64, ROUNDS = 64 };

/* FIPS 180-4, 4.2.2. */
static const uint32_t constants[ROUNDS] = {
    0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4, 0xab1c5ed5,
    0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe, 0x9bdc06a7, 0xc19bf174,
    0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f, 0x4a7484aa, 0x5cb0a9dc, 0x76f988da,
    0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7, 0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967,
    0x27b70a85, 0x2e1b2138, 0x4d2c6dfc, 0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85,
    0xa2bfe8a1, 0xa81a664b, 0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070,
    0x19a4c116, 0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3,
    0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7, 0xc67178f2};

#define WITH_SHA __attribute__((target("sha,sse4.1")))

/* Both halves of the state, in the order of the instructions: a b e f and c d g h. */
typedef struct halves {
  __m128i abef, cdgh;
} halves;

WITH_SHA static inline halves four_rounds(halves h, int first, __m128i words) {
  __m128i sum = _mm_add_epi32(words, _mm_loadu_si128((const __m128i *)(constants + first)));
  h.cdgh = _mm_sha256rnds2_epu32(h.cdgh, h.abef, sum);
  h.abef = _mm_sha256rnds2_epu32(h.abef, h.cdgh, _mm_shuffle_epi32(sum, 0x0e));
  return h;
}

/* The four words that follow these sixteen. */
WITH_SHA static inline __m128i next_words(__m128i w0, __m128i w1, __m128i w2, __m128i w3) {
  __m128i sum = _mm_add_epi32(_mm_sha256msg1_epu32(w0, w1), _mm_alignr_epi8(w3, w2, 4));
  return _mm_sha256msg2_epu32(sum, w3);
}

WITH_SHA static inline __m128i load_words(const unsigned char *at) {
  const __m128i big_endian = _mm_set_epi64x(0x0c0d0e0f08090a0b, 0x0405060700010203);
  return _mm_shuffle_epi8(_mm_loadu_si128((const __m128i *)at), big_endian);
}

WITH_SHA static void add_blocks(uint32_t state[8], const unsigned char *at, size_t blocks) {
  __m128i *stored = (__m128i *)state;
  __m128i cdab = _mm_shuffle_epi32(_mm_loadu_si128(stored), 0xb1);
  __m128i efgh = _mm_shuffle_epi32(_mm_loadu_si128(stored + 1), 0x1b);
  halves h = {_mm_alignr_epi8(cdab, efgh, 8), _mm_blend_epi16(efgh, cdab, 0xf0)};
  for (; blocks > 0; blocks--, at += BLOCK) {
    const halves before = h;
    __m128i w0 = load_words(at), w1 = load_words(at + 16), w2 = load_words(at + 32), w3 = load_words(at + 48);
    for (int round = 0; round < ROUNDS - 16; round += 16) {
      h = four_rounds(h, round, w0);
      w0 = next_words(w0, w1, w2, w3);
      h = four_rounds(h, round + 4, w1);
      w1 = next_words(w1, w2, w3, w0);
      h = four_rounds(h, round + 8, w2);
      w2 = next_words(w2, w3, w0, w1);
      h = four_rounds(h, round + 12, w3);
      w3 = next_words(w3, w0, w1, w2);
    }
    h = four_rounds(h, 48, w0);
    h = four_rounds(h, 52, w1);
    h = four_rounds(h, 56, w2);
    h = four_rounds(h, 60, w3);
    h.abef = _mm_add_epi32(h.abef, before.abef);
    h.cdgh = _mm_add_epi32(h.cdgh, before.cdgh);
  }
  __m128i feba = _mm_shuffle_epi32(h.abef, 0x1b), dchg = _mm_shuffle_epi32(h.cdgh, 0xb1);
  _mm_storeu_si128(stored, _mm_blend_epi16(feba, dchg, 0xf0));
  _mm_storeu_si128(stored + 1, _mm_alignr_epi8(dchg, feba, 8));
}

static int has_sha(void) {
  static int known; /* 0: not yet. Two threads may both find it out */
  int has = __atomic_load_n(&known, __ATOMIC_RELAXED);
  if (!has) {
    unsigned a, b = 0, c = 0, d;
    has = __get_cpuid(1, &a, &b, &c, &d) && (c & bit_SSE4_1) && __get_cpuid_count(7, 0, &a, &b, &c, &d) && (b & bit_SHA)
              ? 1
              : -1;
    __atomic_store_n(&known, has, __ATOMIC_RELAXED);
  }
  return has > 0;
}

void api_sha256_add(crypto_hash_sha256_state *state, const void *bytes, size_t size) {
  const unsigned char *at = bytes;
  size_t waiting = (size_t)(state->count / 8 % BLOCK), first = waiting ? BLOCK - waiting : 0; /* count: in bits */
  if (size < first + BLOCK || !has_sha()) {
    crypto_hash_sha256_update(state, at, size);
    return;
  }
  crypto_hash_sha256_update(state, at, first);
  size_t blocks = (size - first) / BLOCK, taken = first + blocks * BLOCK;
  add_blocks(state->state, at + first, blocks);
  state->count += (uint64_t)blocks * BLOCK * 8;
  crypto_hash_sha256_update(state, at + taken, size - taken);
}

#else

void api_sha256_add(crypto_hash_sha256_state *state, const void *bytes, size_t size) {
  crypto_hash_sha256_update(state, bytes, size);
}

#endif
