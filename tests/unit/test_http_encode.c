/* Accept-Encoding as RFC 9110 section 12.5.3 defines it, and compressed answers in memory. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "http/encoded.h"

static void accepted(void **state) {
  static const struct {
    const char *header;
    coding which;
  } cases[] = {{"", CODING_NONE},
               {"identity", CODING_NONE},
               {"gzip", CODING_GZIP},
               {"gzip, zstd", CODING_ZSTD},
               {"gzip;q=0.9,zstd;q=0.8", CODING_GZIP},
               {"*;q=0.1", CODING_ZSTD},
               {"*;q=0", CODING_NONE},
               {"zstd;q=0,*", CODING_GZIP},
               {"gzip;q=0.001", CODING_GZIP},
               {"gzip;q=0.000", CODING_NONE},
               {"gzip;q=1.5", CODING_NONE},
               {"gzip;q=", CODING_NONE},
               {"gzip;Q=1.000", CODING_GZIP},
               {"gzip;q=0.5,identity;q=0.6", CODING_NONE},
               {";;,gzip", CODING_GZIP},
               {"gzi,gzipp, ,", CODING_NONE}};
  (void)state;
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
    assert_int_equal(coding_accepted(&cases[i].header, 1), cases[i].which);
  }
  const char *lines[] = {"gzip;q=0.1", "zstd;q=0.05"};
  assert_int_equal(coding_accepted(lines, 2), CODING_GZIP);
  assert_int_equal(coding_accepted(NULL, 0), CODING_NONE);
}

static int gather(void *user, const char *bytes, size_t size) {
  char **at = user;
  memcpy(*at, bytes, size);
  *at += size;
  return 1;
}

/* The decoder of request bodies reads what the encoder writes. */
static void same_bytes(void **state) {
  char text[50000], back[sizeof text];
  (void)state;
  for (size_t i = 0; i < sizeof text; i++) {
    text[i] = (char)("abcdefgh"[i % 8] + (char)(i / 5000));
  }
  for (coding which = CODING_GZIP; which <= CODING_ZSTD; which++) {
    for (int once = 0; once < 2; once++) {
      void *out;
      size_t size;
      char *at = back;
      assert_true(encode_bytes(which, text, sizeof text, once, &out, &size));
      assert_true(size < sizeof text / 10);
      decoder *d = decoder_create(which);
      assert_int_equal(decoder_feed(d, out, size, gather, &at), DECODE_OK);
      assert_true(decoder_complete(d));
      assert_int_equal(at - back, sizeof text);
      assert_memory_equal(back, text, sizeof text);
      decoder_free(d);
      free(out);
    }
  }
}

static void not_smaller(void **state) {
  unsigned char noise[4096];
  uint64_t x = 88172645463325252u;
  void *out;
  size_t size;
  (void)state;
  for (size_t i = 0; i < sizeof noise; i++) { /* xorshift64 */
    x ^= x << 13;
    x ^= x >> 7;
    x ^= x << 17;
    noise[i] = (unsigned char)(x >> 24);
  }
  for (coding which = CODING_GZIP; which <= CODING_ZSTD; which++) {
    assert_false(encode_bytes(which, noise, sizeof noise, 0, &out, &size));
    assert_false(encode_bytes(which, noise, 0, 0, &out, &size));
  }
  encoded_cache *c = encoded_open(1 << 20, NULL);
  const encoded *e = encoded_make(c, "noise", CODING_GZIP, noise, sizeof noise);
  assert_non_null(e);
  assert_null(e->bytes);
  assert_ptr_equal(encoded_find(c, "noise", CODING_GZIP), e); /* it is not tried again */
  encoded_release(e);
  encoded_release(e);
  encoded_close(c);
}

static void least_recent_first(void **state) {
  char text[20000], tag[16];
  (void)state;
  memset(text, 'a', sizeof text);
  encoded_cache *c = encoded_open(2000, NULL); /* room for a few */
  const encoded *kept = encoded_make(c, "kept", CODING_GZIP, text, sizeof text);
  assert_null(encoded_find(c, "kept", CODING_ZSTD));
  for (int i = 0; i < 50; i++) {
    snprintf(tag, sizeof tag, "%d", i);
    encoded_release(encoded_make(c, tag, CODING_GZIP, text, sizeof text));
    const encoded *first = encoded_find(c, "0", CODING_GZIP); /* in use, so it stays */
    assert_non_null(first);
    encoded_release(first);
  }
  assert_null(encoded_find(c, "1", CODING_GZIP));
  const encoded *last = encoded_find(c, "49", CODING_GZIP);
  assert_non_null(last);
  encoded_release(last);
  assert_null(encoded_find(c, "kept", CODING_GZIP));
  assert_int_equal(((const unsigned char *)kept->bytes)[0], 0x1f); /* a reference outlives the place in the cache */
  encoded_release(kept);
  encoded_close(c);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(accepted), cmocka_unit_test(same_bytes),
                                     cmocka_unit_test(not_smaller), cmocka_unit_test(least_recent_first)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
