/* UTF-8 as RFC 3629 has it: no overlong forms, no surrogates, nothing above U+10FFFF. */
#ifndef ORBMORPH_UTF8_H
#define ORBMORPH_UTF8_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The bytes of the character at p, of which at most `most` (≥ 1) may be looked at; 0 if it is none. In a text that ends
 * in NUL `most` may be 4: NUL continues nothing, and is itself a character of one byte. */
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
