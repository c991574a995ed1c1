/* SHA-256 by the processor's instructions: the same digests as libsodium's, and those of FIPS 180-4. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "api/sha256.h"

enum { MOST = 400, DIGEST = crypto_hash_sha256_BYTES };

static void assert_digest(crypto_hash_sha256_state *hash, const unsigned char *bytes, size_t size) {
  unsigned char digest[DIGEST], expected[DIGEST];
  crypto_hash_sha256_final(hash, digest);
  crypto_hash_sha256(expected, bytes, size);
  assert_memory_equal(digest, expected, DIGEST);
}

/* Every size up to several blocks, cut at every place into two calls. */
static void test_cuts(void **state) {
  (void)state;
  unsigned char bytes[MOST];
  for (size_t i = 0; i < MOST; i++) {
    bytes[i] = (unsigned char)(i * i + 7 * i / 3);
  }
  for (size_t size = 0; size <= MOST; size++) {
    for (size_t cut = 0; cut <= size; cut++) {
      crypto_hash_sha256_state hash;
      crypto_hash_sha256_init(&hash);
      api_sha256_add(&hash, bytes, cut);
      api_sha256_add(&hash, bytes + cut, size - cut);
      assert_digest(&hash, bytes, size);
    }
  }
}

/* FIPS 180-4's million letters a, in calls of a size that divides no block, from an unaligned address. */
static void test_million(void **state) {
  (void)state;
  static unsigned char letters[10007];
  unsigned char digest[DIGEST];
  char hex[2 * DIGEST + 1];
  crypto_hash_sha256_state hash;
  memset(letters, 'a', sizeof letters);
  crypto_hash_sha256_init(&hash);
  for (size_t left = 1000000; left > 0;) {
    size_t part = left < 9999 ? left : 9999;
    api_sha256_add(&hash, letters + 1, part);
    left -= part;
  }
  crypto_hash_sha256_final(&hash, digest);
  sodium_bin2hex(hex, sizeof hex, digest, sizeof digest);
  assert_string_equal(hex, "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_cuts), cmocka_unit_test(test_million)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
