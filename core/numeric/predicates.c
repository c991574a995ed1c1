/* The sign of a 3×3 determinant.
 *
 * Filter. With u = b − a and w = c − a the determinant is a·(u × w). Each difference, product and sum rounds by a
 * factor within 1 ± ε, ε = 2⁻⁵³; along any path from the inputs to the result there are at most 7 of them, so the
 * computed value is off by at most 7ε(1 + O(ε)) times the permanent P = Σ|a_i|(|u_j w_k| + |u_k w_j|), which itself is
 * computed to a relative 7ε. 1e-15 > 9ε covers both. Differences do not underflow inexactly; a product that underflows
 * adds at most 2⁻¹⁰⁷⁵, which is multiplied by at most 1e100 where all |coordinates| ≤ 1e100: the nine products add less
 * than 1e-220 in all. Under that bound nothing overflows (1e100³·24). So |d| > 1e-15 P + 1e-220 proves the sign of d.
 *
 * Exact. Each double is ±m·2^e with an integer m < 2⁵³. The determinant is a sum of six integers below 2¹⁵⁹, each times
 * a power of two between 2⁻³²²² and 2²⁹¹³. They are added in two's complement in one wide integer whose lowest bit
 * stands for the least of the six exponents: at most (6135 + 159 + 3) bits, that is 99 words of 64 bits. Nothing
 * rounds or overflows, so the sign is correct for all finite doubles. Expansions (Shewchuk 1997) would fail where
 * products under- or overflow; integers do not.
 */
#include "numeric/predicates.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

enum { WORDS = 104 }; /* of 64 bits; at least the 99 derived above */

typedef struct exact_number {
  uint64_t mantissa;
  int exponent;
  int negative;
} exact_number;

typedef struct exact_term {
  uint64_t word[3]; /* a product of three mantissas, lowest word first */
  int exponent, negative;
} exact_term;

static exact_number decompose(double value) {
  uint64_t bits;
  memcpy(&bits, &value, sizeof bits);
  int biased = (int)(bits >> 52 & 0x7ff);
  uint64_t fraction = bits & ((UINT64_C(1) << 52) - 1);
  exact_number out = {.negative = (int)(bits >> 63)};
  out.mantissa = biased ? fraction | UINT64_C(1) << 52 : fraction;
  out.exponent = (biased ? biased : 1) - 1075;
  return out;
}

static exact_term multiply(exact_number x, exact_number y, exact_number z) {
  __extension__ typedef unsigned __int128 wide;
  wide xy = (wide)x.mantissa * y.mantissa;
  wide low = (wide)(uint64_t)xy * z.mantissa;
  wide high = (wide)(uint64_t)(xy >> 64) * z.mantissa + (uint64_t)(low >> 64);
  exact_term out = {.exponent = x.exponent + y.exponent + z.exponent, .negative = x.negative ^ y.negative ^ z.negative};
  out.word[0] = (uint64_t)low;
  out.word[1] = (uint64_t)high;
  out.word[2] = (uint64_t)(high >> 64);
  return out;
}

/* sum += ±term·2^shift modulo 2^(64·words). */
static void accumulate(uint64_t *sum, int words, const exact_term *term, int shift) {
  int at = shift / 64, bit = shift % 64;
  uint64_t shifted[4] = {term->word[0], term->word[1], term->word[2], 0};
  if (bit) {
    for (int i = 3; i > 0; i--) {
      shifted[i] = shifted[i] << bit | shifted[i - 1] >> (64 - bit);
    }
    shifted[0] <<= bit;
  }
  unsigned carry = 0;
  for (int i = at; i < words; i++) {
    uint64_t part = i - at < 4 ? shifted[i - at] : 0, old = sum[i];
    if (term->negative) {
      uint64_t difference = old - part;
      sum[i] = difference - carry;
      carry = (old < part) | (difference < carry);
    } else {
      uint64_t total = old + part;
      sum[i] = total + carry;
      carry = (total < old) | (sum[i] < total);
    }
    if (i - at >= 3 && !carry) {
      break;
    }
  }
}

static int exact_sign(const double a[3], const double b[3], const double c[3]) {
  exact_number x[3], y[3], z[3];
  for (int i = 0; i < 3; i++) {
    x[i] = decompose(a[i]);
    y[i] = decompose(b[i]);
    z[i] = decompose(c[i]);
  }
  exact_term term[6];
  int count = 0, low = 0, high = 0;
  for (int i = 0; i < 3; i++) {
    int j = (i + 1) % 3, k = (i + 2) % 3;
    term[2 * i] = multiply(x[i], y[j], z[k]);
    term[2 * i + 1] = multiply(x[i], y[k], z[j]);
    term[2 * i + 1].negative ^= 1;
  }
  for (int i = 0; i < 6; i++) {
    if (term[i].word[0] | term[i].word[1] | term[i].word[2]) {
      low = count == 0 || term[i].exponent < low ? term[i].exponent : low;
      high = count == 0 || term[i].exponent > high ? term[i].exponent : high;
      term[count++] = term[i];
    }
  }
  if (count == 0) {
    return 0;
  }
  int words = (high - low + 159 + 4) / 64 + 1;
  uint64_t sum[WORDS];
  memset(sum, 0, (size_t)words * sizeof sum[0]);
  for (int i = 0; i < count; i++) {
    accumulate(sum, words, &term[i], term[i].exponent - low);
  }
  if (sum[words - 1] >> 63) {
    return -1;
  }
  for (int i = 0; i < words; i++) {
    if (sum[i]) {
      return 1;
    }
  }
  return 0;
}

/* Also 0 where a coordinate is not finite. */
static int decide_exactly(const double a[3], const double b[3], const double c[3]) {
  for (int i = 0; i < 3; i++) {
    if (!isfinite(a[i]) || !isfinite(b[i]) || !isfinite(c[i])) {
      return 0;
    }
  }
  return exact_sign(a, b, c);
}

static int coincide(const double a[3], const double b[3]) {
  return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

int orb_orient_careful(const double a[3], const double b[3], const double c[3]) {
  double size = fabs(a[0]) + fabs(a[1]) + fabs(a[2]) + fabs(b[0]) + fabs(b[1]) + fabs(b[2]) + fabs(c[0]) + fabs(c[1]) +
                fabs(c[2]);
  if (size <= 1e100) { /* false if a coordinate is NaN */
    double ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2], wx = c[0] - a[0], wy = c[1] - a[1], wz = c[2] - a[2];
    double yz = uy * wz, zy = uz * wy, zx = uz * wx, xz = ux * wz, xy = ux * wy, yx = uy * wx;
    double d = a[0] * (yz - zy) + a[1] * (zx - xz) + a[2] * (xy - yx);
    double permanent =
        fabs(a[0]) * (fabs(yz) + fabs(zy)) + fabs(a[1]) * (fabs(zx) + fabs(xz)) + fabs(a[2]) * (fabs(xy) + fabs(yx));
    if (fabs(d) > ORB_ORIENT_RELATIVE * permanent + ORB_ORIENT_LEAST) {
      return d > 0 ? 1 : -1;
    }
  }
  if (coincide(a, b) || coincide(b, c) ||
      coincide(c, a)) { /* most calls that get this far: both points are the same vertex */
    return 0;
  }
  return decide_exactly(a, b, c);
}
