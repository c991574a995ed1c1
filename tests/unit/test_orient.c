/* Compares orb_orient() with exact integers where doubles give the wrong sign: nearly flat, subnormal, huge, mixed. */
#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "numeric/predicates.h"
#include "support_exact.h"

static uint64_t state = 88172645463325252U;
static uint64_t random_bits(void) {
  state ^= state << 13;
  state ^= state >> 7;
  state ^= state << 17;
  return state;
}
static double uniform(void) {
  return (double)(random_bits() >> 11) / 9007199254740992.0 * 2 - 1;
}

static int counts[3];
static void check(double v[3][3]) {
  int want = exact_orientation(v[0], v[1], v[2]);
  counts[want + 1]++;
  assert_int_equal(orb_orient(v[0], v[1], v[2]), want);
  assert_int_equal(orb_orient(v[1], v[2], v[0]), want);
  assert_int_equal(orb_orient(v[1], v[0], v[2]), -want);
}

static void test_known(void **unused) {
  (void)unused;
  double x[3] = {1, 0, 0}, y[3] = {0, 1, 0}, z[3] = {0, 0, 1}, zero[3] = {0, 0, 0};
  assert_int_equal(orb_orient(x, y, z), 1);
  assert_int_equal(orb_orient(y, x, z), -1);
  assert_int_equal(orb_orient(x, y, x), 0);
  assert_int_equal(orb_orient(x, y, zero), 0);
  double bad[3] = {NAN, 0, 1}, far[3] = {0, INFINITY, 0};
  assert_int_equal(orb_orient(x, y, bad), 0);
  assert_int_equal(orb_orient(far, y, x), 0);
}

static void test_random(void **unused) {
  (void)unused;
  for (int i = 0; i < 300; i++) {
    double v[3][3];
    for (int k = 0; k < 9; k++) {
      v[k / 3][k % 3] = uniform();
    }
    check(v);
  }
}

/* c = s·a + t·b, rounded: a few units in the last place decide. */
static void test_nearly_flat(void **unused) {
  (void)unused;
  memset(counts, 0, sizeof counts);
  for (int i = 0; i < 1500; i++) {
    double v[3][3], s = uniform(), t = uniform(), scale = ldexp(1, -(i % 60));
    for (int k = 0; k < 3; k++) {
      v[0][k] = uniform();
      v[1][k] = i % 2 ? v[0][k] + scale * uniform() : uniform();
      v[2][k] = s * v[0][k] + t * v[1][k];
    }
    v[2][i % 3] = nextafter(v[2][i % 3], i % 5 < 2 ? 2 : -2);
    check(v);
  }
  assert_true(counts[0] > 100 && counts[2] > 100); /* both signs are met */
}

/* Small integers times powers of two: many are exactly flat. */
static void test_exactly_flat(void **unused) {
  (void)unused;
  memset(counts, 0, sizeof counts);
  for (int i = 0; i < 600; i++) {
    double v[3][3], scale = ldexp(1, (int)(random_bits() % 600) - 300);
    int s = (int)(random_bits() % 9) - 4, t = (int)(random_bits() % 9) - 4;
    for (int k = 0; k < 3; k++) {
      v[0][k] = (double)((int64_t)(random_bits() % 2001) - 1000);
      v[1][k] = (double)((int64_t)(random_bits() % 2001) - 1000);
      v[2][k] = (s * v[0][k] + t * v[1][k]) * scale;
    }
    if (i % 3 == 0) {
      v[2][0] += ldexp(1, -40) * scale;
    }
    check(v);
  }
  assert_true(counts[1] > 300);
}

/* Arbitrary bit patterns, and products that underflow or overflow although the sign is clear. */
static void test_extremes(void **unused) {
  (void)unused;
  memset(counts, 0, sizeof counts);
  for (int i = 0; i < 600; i++) {
    double v[3][3];
    for (int k = 0; k < 9; k++) {
      uint64_t bits = random_bits();
      if (i % 4 == 1) { /* subnormal */
        bits &= UINT64_C(0x800fffffffffffff);
      } else if (i % 4 == 2) { /* huge */
        bits = (bits & UINT64_C(0x803fffffffffffff)) | UINT64_C(0x7fc0000000000000);
      }
      double x;
      memcpy(&x, &bits, sizeof x);
      v[k / 3][k % 3] = isfinite(x) ? x : DBL_MAX;
    }
    if (i % 4 == 3) { /* flat but for one bit of the least */
      for (int k = 0; k < 3; k++) {
        v[2][k] = v[0][k];
      }
      v[2][i % 3] = nextafter(v[2][i % 3], 0);
    }
    check(v);
  }
  double tiny = DBL_TRUE_MIN, v[3][3] = {{tiny, 0, 0}, {0, tiny, 0}, {0, 0, tiny}};
  check(v);
  double huge[3][3] = {{DBL_MAX, DBL_MAX, 0}, {0, DBL_MAX, DBL_MAX}, {DBL_MAX, 0, DBL_MAX}};
  check(huge);
  double mixed[3][3] = {{DBL_MAX, tiny, 0}, {tiny, DBL_MAX, tiny}, {0, tiny, tiny}};
  check(mixed);
  assert_true(counts[0] > 100 && counts[2] > 100);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_known), cmocka_unit_test(test_random),
                                     cmocka_unit_test(test_nearly_flat), cmocka_unit_test(test_exactly_flat),
                                     cmocka_unit_test(test_extremes)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
