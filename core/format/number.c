/* Decimal to double, correctly rounded, in one of three ways:
 *  1. at most 15 digits and a power of ten up to 22 are both doubles, so one multiplication or division rounds once
 *     (Clinger 1990);
 *  2. up to 19 digits and a power up to 19 both fit 64 bits, so their product or quotient in 128 bits, with a sticky
 *     bit, is rounded to 53 bits here;
 *  3. everything else goes to strtod() as digits without a point, which every locale reads alike, cut to 800 digits and
 *     a sticky one: 768 digits decide.
 */
#include "format/number.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
  MAX_DIGITS = 800,     /* see 3. above */
  MAX_EXPONENT = 100000 /* beyond it every number of MAX_DIGITS digits is 0 or infinite */
};

static const double POWERS[23] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                                  1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

/* mantissa · 2^shift, with a sticky bit below, rounded to nearest, ties to even. The result is a normal double. */
static double round_to_double(uint64_t mantissa, int shift, int sticky) {
  int drop = 64 - __builtin_clzll(mantissa) - 53;
  if (drop > 0) {
    uint64_t rest = mantissa & ((1ull << drop) - 1), half = 1ull << (drop - 1);
    mantissa >>= drop;
    shift += drop;
    if (rest > half || (rest == half && (sticky || (mantissa & 1)))) {
      mantissa++;
    }
  }
  return ldexp((double)mantissa, shift);
}

static uint64_t integer_power(int exponent) {
  uint64_t power = 1;
  for (int i = 0; i < exponent; i++) {
    power *= 10;
  }
  return power;
}

/* digits · 10^exponent for digits > 0, |exponent| ≤ 19. */
static double scale_exactly(uint64_t digits, int exponent) {
  int zeros = __builtin_clzll(digits);
  uint64_t normal = digits << zeros;
  if (exponent >= 0) {
    unsigned __int128 product = (unsigned __int128)normal * integer_power(exponent);
    uint64_t high = (uint64_t)(product >> 64), low = (uint64_t)product;
    if (high == 0) {
      return round_to_double(low, -zeros, 0);
    }
    int up = __builtin_clzll(high); /* fills all 64 bits of the window */
    uint64_t window = up ? (high << up) | (low >> (64 - up)) : high;
    return round_to_double(window, 64 - up - zeros, (low << up) != 0);
  }
  uint64_t power = integer_power(-exponent);
  int up = __builtin_clzll(power);
  uint64_t divisor = power << up; /* top bit set: the quotient of (normal/2 · 2^64) by it has 63 or 64 bits */
  unsigned __int128 dividend = (unsigned __int128)normal << 63;
  uint64_t quotient = (uint64_t)(dividend / divisor), rest = (uint64_t)(dividend % divisor);
  return round_to_double(quotient, up - zeros - 63, rest != 0);
}

/* The general case, from the text of the token: digits at [p, end), perhaps with a point among them. */
static double convert_long(const unsigned char *p, const unsigned char *end, int64_t exponent) {
  char text[MAX_DIGITS + 32];
  int count = 0, point = 0, sticky = 0;
  for (; p < end; p++) {
    if (*p == '.') {
      point = 1;
      continue;
    }
    if (count == 0 && *p == '0') {
      exponent -= point;
      continue;
    }
    if (count < MAX_DIGITS) {
      text[count++] = (char)*p;
      exponent -= point;
    } else {
      sticky |= *p != '0';
      exponent += !point;
    }
  }
  if (count == 0) {
    return 0;
  }
  if (sticky) {
    text[count++] = '1';
    exponent--;
  }
  exponent = exponent > MAX_EXPONENT ? MAX_EXPONENT : exponent < -MAX_EXPONENT ? -MAX_EXPONENT : exponent;
  snprintf(text + count, 16, "e%d", (int)exponent);
  return strtod(text, NULL);
}

static int is_word(const unsigned char *p, const unsigned char *end, const char *word) {
  for (; *word; p++, word++) {
    if (p == end || (*p | 32) != (unsigned char)*word) {
      return 0;
    }
  }
  return 1;
}

static const unsigned char *parse_special(const unsigned char *p, const unsigned char *end, int negative, double *out) {
  if (is_word(p, end, "infinity")) {
    p += 8;
  } else if (is_word(p, end, "inf")) {
    p += 3;
  } else if (is_word(p, end, "nan")) {
    p += 3;
    while ((p < end) && (*p > ' ') && *p != '/' && *p != '#') {
      p++; /* nan(ind) and the like */
    }
    *out = NAN;
    return p;
  } else {
    return NULL;
  }
  *out = negative ? -INFINITY : INFINITY;
  return p;
}

/* The exponent at p, if there is one: e or d, a sign, digits. Returns its end; NULL if the digits are missing. *given
 * is limited to about 10^16, so that it cannot overflow. */
static const unsigned char *parse_exponent(const unsigned char *p, const unsigned char *end, int64_t *given) {
  int down = 0;
  *given = 0;
  if (p == end || ((*p | 32) != 'e' && (*p | 32) != 'd')) {
    return p;
  }
  p++;
  if (p < end && (*p == '-' || *p == '+')) {
    down = *p++ == '-';
  }
  if (p == end || (unsigned)(*p - '0') >= 10) {
    return NULL;
  }
  for (; p < end && (unsigned)(*p - '0') < 10; p++) {
    *given = *given < (int64_t)1 << 50 ? *given * 10 + (*p - '0') : *given;
  }
  *given = down ? -*given : *given;
  return p;
}

const unsigned char *orb_number_parse(const unsigned char *p, const unsigned char *end, double *out) {
  int negative = 0;
  if (p < end && (*p == '-' || *p == '+')) {
    negative = *p++ == '-';
  }
  const unsigned char *first = p;
  uint64_t digits = 0;
  int64_t exponent = 0, given = 0;
  int significant = 0;
  while (p < end && (unsigned)(*p - '0') < 10) {
    digits = digits * 10 + (unsigned)(*p++ - '0');
    significant += digits != 0; /* wraps beyond 19 digits: not used then */
    if (significant > 19) {
      break;
    }
  }
  const unsigned char *scan = p;
  while (scan < end && (unsigned)(*scan - '0') < 10) {
    scan++;
    significant = 20;
  }
  int64_t count = scan - first;
  p = scan;
  if (p < end && *p == '.') {
    const unsigned char *point = ++p;
    while (p < end && (unsigned)(*p - '0') < 10) {
      if (significant < 20) {
        digits = digits * 10 + (unsigned)(*p - '0');
        significant += digits != 0;
      }
      p++;
    }
    exponent = point - p;
    count += p - point;
  }
  if (count == 0) {
    return parse_special(first, end, negative, out);
  }
  const unsigned char *last = p;
  p = parse_exponent(p, end, &given);
  if (!p) {
    return NULL;
  }
  exponent += given;
  double value;
  if (significant <= 19 && digits == 0) {
    value = 0;
  } else if (significant <= 15 && exponent >= -22 && exponent <= 22) {
    value = exponent < 0 ? (double)digits / POWERS[-exponent] : (double)digits * POWERS[exponent];
  } else if (significant <= 19 && exponent >= -19 && exponent <= 19) {
    value = scale_exactly(digits, (int)exponent);
  } else {
    value = convert_long(first, last, given);
  }
  *out = negative ? -value : value;
  return p;
}
