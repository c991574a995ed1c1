/* UTF-8 as RFC 3629 defines it: no overlong forms, no surrogates, nothing above U+10FFFF.
 *
 * Names of shapes and landmarks are UTF-8. An asset gets U+FFFD for each byte that is not; a program that would rather
 * refuse such a name checks it with this function. */
#ifndef ORBMORPH_UTF8_H
#define ORBMORPH_UTF8_H

#include <stddef.h>

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

#ifdef __cplusplus
}
#endif
#endif
