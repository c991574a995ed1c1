/* Compares the linear solver, the 3 × 3 singular values and the nearest rotation with their definitions. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "numeric/dense.h"
#include "numeric/rotation.h"

static uint64_t state = 88172645463325252ULL;
static double uniform(void) { /* −1 … 1 */
  state ^= state << 13;
  state ^= state >> 7;
  state ^= state << 17;
  return (double)(int64_t)state / 9.3e18;
}

/* Computes A · X from a known X, for sizes below and above the block size and with a zero as first diagonal entry. */
static void test_solve(void **unused) {
  (void)unused;
  static const int32_t sizes[] = {1, 2, 3, 31, 32, 33, 64, 65, 150, 300};
  for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
    int32_t n = sizes[k];
    size_t m = (size_t)n;
    double *a = malloc(m * m * sizeof *a), *x = malloc(3 * m * sizeof *x), *b = calloc(3 * m, sizeof *b);
    for (size_t i = 0; i < m * m; i++) {
      a[i] = uniform();
    }
    if (n > 1) {
      a[0] = 0;
    }
    for (size_t i = 0; i < 3 * m; i++) {
      x[i] = uniform();
    }
    for (size_t i = 0; i < m; i++) {
      for (size_t j = 0; j < m; j++) {
        for (size_t c = 0; c < 3; c++) {
          b[3 * i + c] += a[i * m + j] * x[3 * j + c];
        }
      }
    }
    assert_int_equal(orb_dense_solve(n, a, 3, b), 0);
    for (size_t i = 0; i < 3 * m; i++) {
      assert_true(fabs(b[i] - x[i]) < 1e-9);
    }
    free(a);
    free(x);
    free(b);
  }
}

static void test_singular(void **unused) {
  (void)unused;
  double a[9] = {1, 2, 3, 2, 4, 6, 0, 1, 5}, b[3] = {1, 2, 3}; /* the second row is twice the first */
  assert_int_equal(orb_dense_solve(3, a, 1, b), -1);
  double c[4] = {INFINITY, 1, 1, 1}, d[2] = {1, 1};
  assert_int_equal(orb_dense_solve(2, c, 1, d), -1);
}

static void check_svd(const double a[9]) {
  double u[9], s[3], v[9], scale = 0;
  orb_svd3(a, u, s, v);
  assert_true(s[0] >= s[1] && s[1] >= s[2] && s[2] >= 0);
  for (int i = 0; i < 9; i++) {
    scale = fmax(scale, fabs(a[i]));
  }
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++) {
      double product = 0, uu = 0, vv = 0;
      for (int k = 0; k < 3; k++) {
        product += u[3 * i + k] * s[k] * v[3 * j + k];
        uu += u[3 * k + i] * u[3 * k + j];
        vv += v[3 * k + i] * v[3 * k + j];
      }
      assert_true(fabs(product - a[3 * i + j]) <= 1e-14 * scale);
      assert_true(fabs(uu - (i == j)) < 1e-14);
      assert_true(fabs(vv - (i == j)) < 1e-14);
    }
  }
}

static void test_svd(void **unused) {
  (void)unused;
  static const double special[][9] = {{0, 0, 0, 0, 0, 0, 0, 0, 0},
                                      {1, 0, 0, 0, 1, 0, 0, 0, 1},
                                      {0, 1, 0, 0, 0, 1, 1, 0, 0},
                                      {1, 2, 3, 2, 4, 6, 3, 6, 9},
                                      {1, 0, 0, 0, 0, 0, 0, 0, 0},
                                      {-2, 0, 0, 0, 3, 0, 0, 0, -1},
                                      {1e200, 0, 1e199, 0, 1e198, 0, 0, 0, 1},
                                      {1e-200, 2e-200, 0, 0, 3e-201, 0, 1e-201, 0, 1e-200},
                                      {1, 1, 1, 1, 1, 1 + 1e-15, 1, 1 - 1e-15, 1}};
  for (size_t i = 0; i < sizeof special / sizeof *special; i++) {
    check_svd(special[i]);
  }
  for (int i = 0; i < 10000; i++) {
    double a[9];
    for (int k = 0; k < 9; k++) {
      a[k] = uniform() * pow(10, 6 * uniform());
    }
    check_svd(a);
  }
  double u[9], s[3], v[9]; /* singular values that are known: 3, 2, 1 */
  orb_svd3((const double[9]){0, -2, 0, 0, 0, 1, 3, 0, 0}, u, s, v);
  assert_true(fabs(s[0] - 3) < 1e-15 && fabs(s[1] - 2) < 1e-15 && fabs(s[2] - 1) < 1e-15);
}

/* The rotation nearest to h has the greatest trace of Rᵀ h: the sum of the singular values, the least of them negated
 * where h mirrors. */
static void check_nearest(const double h[9], const double r[9]) {
  double u[9], s[3], v[9], trace = 0;
  orb_svd3(h, u, s, v);
  const double det =
      h[0] * (h[4] * h[8] - h[5] * h[7]) - h[1] * (h[3] * h[8] - h[5] * h[6]) + h[2] * (h[3] * h[7] - h[4] * h[6]);
  for (int i = 0; i < 9; i++) {
    trace += r[i] * h[i];
    double product = 0;
    for (int k = 0; k < 3; k++) {
      product += r[3 * (i / 3) + k] * r[3 * (i % 3) + k];
    }
    assert_true(fabs(product - (i / 3 == i % 3)) < 1e-13);
  }
  assert_true(
      r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) + r[2] * (r[3] * r[7] - r[4] * r[6]) > 0);
  assert_true(fabs(trace - (s[0] + s[1] + (det < 0 ? -s[2] : s[2]))) <= 1e-13 * (s[0] + 1e-300));
}

static void check_rotation(const double h[9]) {
  double r[9];
  assert_int_equal(orb_nearest_rotation(h, r), 1);
  check_nearest(h, r);
}

/* The same, for as many as are given. */
static void check_rotations(double h[ORB_ROTATIONS][9], int count) {
  double at_once[9][ORB_ROTATIONS] = {{0}}, r[9 * ORB_ROTATIONS + 1];
  for (int k = 0; k < 9 * ORB_ROTATIONS; k++) {
    at_once[k % 9][k / 9] = k / 9 < count ? h[k / 9][k % 9] : 0;
  }
  r[9 * count] = 5;
  orb_nearest_rotations(at_once, count, r);
  for (int i = 0; i < count; i++) {
    check_nearest(h[i], r + 9 * i);
  }
  assert_true(r[9 * count] == 5);
}

/* Also for matrices of rank 1 and 2, near a mirror image, and of any size. */
static void test_rotation(void **unused) {
  double several[ORB_ROTATIONS][9];
  (void)unused;
  for (int i = 0; i < 20000; i++) {
    double h[9];
    for (int k = 0; k < 9; k++) {
      h[k] = uniform();
    }
    for (int k = 0; k < 3; k++) {
      h[6 + k] = i % 4 == 1 ? h[k] - h[3 + k] : i % 4 == 2 ? 1e-5 * h[6 + k] : h[6 + k];
      h[3 + k] = i % 4 == 2 ? h[k] : h[3 + k];
    }
    const double scale = pow(10, 30 * uniform());
    for (int k = 0; k < 9; k++) {
      h[k] *= scale;
    }
    check_rotation(h);
    memcpy(several[i % ORB_ROTATIONS], h, sizeof h);
    if (i % ORB_ROTATIONS == i / ORB_ROTATIONS % ORB_ROTATIONS) { /* the last ones are those of the group before */
      check_rotations(several, i < ORB_ROTATIONS ? i + 1 : i % ORB_ROTATIONS + 1);
    }
  }
  double r[9];
  check_rotation((const double[9]){0});
  check_rotation((const double[9]){1, 0, 0, 0, 1, 0, 0, 0, -1});
  check_rotation((const double[9]){-1, 0, 0, 0, -1, 0, 0, 0, -1});
  assert_int_equal(orb_nearest_rotation((const double[9]){NAN}, r), 0);
  double broken[9][ORB_ROTATIONS] = {{NAN, INFINITY}, {0}}, kept[18] = {1, [9] = 2};
  orb_nearest_rotations(broken, 2, kept);
  assert_true(kept[0] == 1 && kept[9] == 2 && kept[8] == 0 && kept[17] == 0);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_solve), cmocka_unit_test(test_singular),
                                     cmocka_unit_test(test_svd), cmocka_unit_test(test_rotation)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
