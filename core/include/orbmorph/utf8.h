/* UTF-8 as RFC 3629 defines it: no overlong forms, no surrogates, nothing above U+10FFFF.
 *
 * Names of shapes and landmarks are UTF-8. An asset gets U+FFFD for each byte that is not valid. A program that refuses
 * such names instead can check them with orb_utf8_length(). */
#ifndef ORBMORPH_UTF8_H
#define ORBMORPH_UTF8_H

#include <stddef.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The length in bytes of the character at p; 0 if there is no valid one. Reads at most `most` (≥ 1) bytes. In a text
 * that ends with NUL, `most` may be 4: NUL never continues a character, and is itself a character of one byte. */
static inline size_t orb_utf8_length(const unsigned char *p, size_t most) {
  unsigned char c = p[0];
  size_t n = c < 0x80 ? 1 : c < 0xc2 ? 0 : c < 0xe0 ? 2 : c < 0xf0 ? 3 : c < 0xf5 ? 4 : 0;
  if (n > most) {
    return 0;
  }
  for (size_t i = 1; i < n; i++) {
    if ((p[i] & 0xc0) != 0x80) {
      return 0;
    }
  }
  int overlong = (c == 0xe0 && p[1] < 0xa0) || (c == 0xf0 && p[1] < 0x90);
  int beyond = (c == 0xed && p[1] > 0x9f) || (c == 0xf4 && p[1] > 0x8f);
  return overlong || beyond ? 0 : n;
}

/* Copies as many whole characters of a text as `size` bytes hold (≥ 1), with NUL at the end. A byte that is not
 * part of a character becomes U+FFFD. Returns the length. */
static inline size_t orb_utf8_copy(char *out, size_t size, const char *text) {
  size_t length = 0;
  for (const unsigned char *p = (const unsigned char *)text; *p;) {
    size_t from = orb_utf8_length(p, 4), n = from ? from : 3;
    if (n >= size - length) {
      break;
    }
    memcpy(out + length, from ? (const char *)p : "\xef\xbf\xbd", n);
    length += n;
    p += from ? from : 1;
  }
  out[length] = 0;
  return length;
}

#ifdef __cplusplus
}
#endif
#endif
