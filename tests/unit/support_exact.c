/* Every finite double is an integer times 2^-1074, so the determinant is an integer times 2^-3222. The base is 2^32. */
#include "support_exact.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { ONE = 67, DIGITS = 3 * ONE + 2 };

typedef struct integer {
  uint32_t digit[DIGITS];
  int used, negative;
} integer;

static void from_double(double x, integer *out) {
  memset(out, 0, sizeof *out);
  out->negative = signbit(x) != 0;
  int exponent;
  double fraction = frexp(fabs(x), &exponent);
  uint64_t mantissa = (uint64_t)ldexp(fraction, 53);
  int shift = exponent - 53 + 1074;
  if (shift < 0) { /* subnormal: the low bits are zero */
    mantissa >>= -shift;
    shift = 0;
  }
  for (int bit = 0; bit < 53; bit++) {
    if (mantissa >> bit & 1) {
      out->digit[(shift + bit) / 32] |= UINT32_C(1) << (shift + bit) % 32;
    }
  }
  out->used = ONE;
}

static void product(const integer *a, const integer *b, integer *out) {
  memset(out, 0, sizeof *out);
  out->negative = a->negative ^ b->negative;
  for (int i = 0; i < a->used; i++) {
    uint64_t carry = 0;
    for (int j = 0; a->digit[i] && j < b->used; j++) {
      carry += (uint64_t)a->digit[i] * b->digit[j] + out->digit[i + j];
      out->digit[i + j] = (uint32_t)carry;
      carry >>= 32;
    }
    if (a->digit[i]) {
      out->digit[i + b->used] = (uint32_t)carry;
    }
  }
  out->used = a->used + b->used;
}

static int compare_size(const integer *a, const integer *b) {
  for (int i = DIGITS - 1; i >= 0; i--) {
    if (a->digit[i] != b->digit[i]) {
      return a->digit[i] < b->digit[i] ? -1 : 1;
    }
  }
  return 0;
}

static void add(integer *sum, const integer *term) {
  uint64_t carry = 0;
  if (sum->negative == term->negative) {
    for (int i = 0; i < DIGITS; i++) {
      carry += (uint64_t)sum->digit[i] + term->digit[i];
      sum->digit[i] = (uint32_t)carry;
      carry >>= 32;
    }
    return;
  }
  int swap = compare_size(sum, term) < 0;
  const integer copy = *sum, *big = swap ? term : &copy, *small = swap ? &copy : term;
  int64_t borrow = 0;
  for (int i = 0; i < DIGITS; i++) {
    borrow += (int64_t)big->digit[i] - small->digit[i];
    sum->digit[i] = (uint32_t)borrow;
    borrow >>= 32;
  }
  sum->negative = big->negative;
}

int exact_orientation(const double a[3], const double b[3], const double c[3]) {
  integer x, y, z, xy, xyz, sum;
  memset(&sum, 0, sizeof sum);
  for (int i = 0; i < 6; i++) {
    int p = i % 3, q = i < 3 ? (p + 1) % 3 : (p + 2) % 3;
    from_double(a[p], &x);
    from_double(b[q], &y);
    from_double(c[3 - p - q], &z);
    product(&x, &y, &xy);
    product(&xy, &z, &xyz);
    xyz.negative ^= i >= 3;
    add(&sum, &xyz);
  }
  for (int i = 0; i < DIGITS; i++) {
    if (sum.digit[i]) {
      return sum.negative ? -1 : 1;
    }
  }
  return 0;
}
