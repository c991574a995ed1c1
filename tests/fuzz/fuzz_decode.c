/* The body of a request in gzip or zstd. The first byte selects the coding and the size of the pieces. The decompressed
 * bytes must not depend on the pieces; a sink that refuses more gets no more; memory stays within a window of 8 MB. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "http/decode.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum { MOST = 4 << 20, MEMORY_MOST = 10 << 20 };

typedef struct sink {
  uint64_t hash;
  size_t size;
  int stopped;
} sink;

static int take(void *user, const char *bytes, size_t size) {
  sink *s = user;
  if (s->stopped || size == 0) {
    abort(); /* called again after it refused more, or with nothing */
  }
  for (size_t i = 0; i < size; i++) {
    s->hash = (s->hash ^ (unsigned char)bytes[i]) * UINT64_C(0x100000001b3);
  }
  s->size += size;
  s->stopped = s->size > MOST;
  return !s->stopped;
}

static decode_result unpack(coding which, const uint8_t *data, size_t size, size_t piece, sink *out, int *whole) {
  decoder *d = decoder_create(which);
  decode_result result = DECODE_OK;
  if (!d) {
    abort();
  }
  for (size_t at = 0; at < size && result == DECODE_OK; at += piece) {
    size_t n = size - at < piece ? size - at : piece;
    char *exact = malloc(n); /* the sanitizer sees a byte beyond */
    if (!exact) {
      abort();
    }
    memcpy(exact, data + at, n);
    result = decoder_feed(d, exact, n, take, out);
    free(exact);
    if (decoder_memory(d) > MEMORY_MOST) {
      abort();
    }
  }
  *whole = decoder_complete(d);
  decoder_free(d);
  return result;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  if (size < 2) {
    return 0;
  }
  coding which = data[0] & 1 ? CODING_GZIP : CODING_ZSTD;
  sink first = {0}, second = {0};
  int whole_first, whole_second;
  decode_result a = unpack(which, data + 1, size - 1, size, &first, &whole_first);
  decode_result b = unpack(which, data + 1, size - 1, 1 + (size_t)(data[0] >> 1), &second, &whole_second);
  if ((a == DECODE_STOPPED) != first.stopped || (b == DECODE_STOPPED) != second.stopped) {
    abort();
  }
  if (a == DECODE_OK &&
      (b != a || first.hash != second.hash || first.size != second.size || whole_first != whole_second)) {
    abort();
  }
  return 0;
}
