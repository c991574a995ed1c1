/* Compares the nearest point of a set of triangles with a plain search over all triangles. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "mesh/nearest.h"
#include "numeric/vec3.h"
#include "support_context.h"

static double uniform(uint64_t *seed) {
  *seed = *seed * 6364136223846793005ull + 1442695040888963407ull;
  return (double)(*seed >> 11) * 0x1p-53;
}

static void no_point_of_a_grid_is_nearer(void **state) {
  (void)state;
  enum { COUNT = 500 };
  static double positions[9 * COUNT];
  static int32_t triangles[3 * COUNT];
  uint64_t seed = 5;
  for (int t = 0; t < COUNT; t++) {
    double centre[3] = {uniform(&seed), uniform(&seed), uniform(&seed)};
    for (int k = 0; k < 9; k++) {
      positions[9 * t + k] = centre[k % 3] + 0.1 * uniform(&seed);
    }
    for (int k = 0; k < 3; k++) {
      triangles[3 * t + k] = 3 * t + k;
    }
  }
  orb_mesh mesh = {.positions = positions, .triangles = triangles, .vertex_count = 3 * COUNT, .triangle_count = COUNT};
  orb_nearest *tree, *one;
  assert_int_equal(orb_nearest_create(ctx, positions, triangles, COUNT, &tree), ORB_OK);
  for (int q = 0; q < 300; q++) {
    double p[3] = {3 * uniform(&seed) - 1, 3 * uniform(&seed) - 1, 3 * uniform(&seed) - 1}, at[3], best = INFINITY;
    orb_place place, other;
    double d2 = orb_nearest_query(tree, p, INFINITY, &place);
    orb_place_position(&mesh, &place, at);
    assert_true(fabs(orb_distance2(p, at) - d2) < 1e-12);
    assert_true(fabs(place.at[0] + place.at[1] + place.at[2] - 1) < 1e-14);
    for (int t = 0; t < COUNT; t++) { /* no point of a fine grid on any triangle is nearer */
      for (int i = 0; i <= 8; i++) {
        for (int j = 0; i + j <= 8; j++) {
          orb_place grid = {t, {i / 8.0, j / 8.0, (8 - i - j) / 8.0}};
          orb_place_position(&mesh, &grid, at);
          best = fmin(best, orb_distance2(p, at));
        }
      }
    }
    assert_true(d2 <= best + 1e-12);
    assert_true(orb_nearest_query(tree, p, d2 * 0.999, &other) == INFINITY && other.triangle == -1);
    assert_int_equal(orb_nearest_create(ctx, positions, triangles + 3 * place.triangle, 1, &one), ORB_OK);
    assert_true(fabs(orb_nearest_query(one, p, INFINITY, &other) - d2) < 1e-13);
    orb_nearest_destroy(ctx, one);
  }
  for (int k = 0; k < 9 * COUNT; k++) { /* squared distances that overflow: the result is still some place */
    positions[k] *= 1e300;
  }
  orb_nearest_destroy(ctx, tree);
  assert_int_equal(orb_nearest_create(ctx, positions, triangles, COUNT, &tree), ORB_OK);
  orb_place far;
  assert_true(orb_nearest_query(tree, (double[3]){-1e300, 0, 1e300}, INFINITY, &far) == INFINITY);
  assert_true(far.triangle >= 0 && far.triangle < COUNT);
  orb_nearest_destroy(ctx, tree);
}

enum { MOST = 5000 };
static double positions[9 * MOST];
static int32_t triangles[3 * MOST];

/* Fills triangle t. */
typedef void (*triangle_fn)(int t, uint64_t *seed, double out[9]);

static void scattered(int t, uint64_t *seed, double out[9]) {
  double centre[3] = {uniform(seed), uniform(seed), uniform(seed)};
  (void)t;
  for (int k = 0; k < 9; k++) {
    out[k] = centre[k % 3] + 0.05 * uniform(seed);
  }
}

/* A flat grid: equal coordinates, and points that are equally near to several triangles. */
static void gridded(int t, uint64_t *seed, double out[9]) {
  int x = t / 2 % 50, y = t / 100, upper = t % 2;
  const double corners[9] = {x, y, 7, x + 1, y + upper, 7, x + !upper, y + 1, 7};
  (void)seed;
  memcpy(out, corners, sizeof corners);
}

/* Copies of one triangle: the lowest number wins. */
static void repeated(int t, uint64_t *seed, double out[9]) {
  static const double one[9] = {-3, 2, 1, 4, 2, 1, 0, 5, 2};
  (void)t;
  (void)seed;
  memcpy(out, one, sizeof one);
}

/* Nearly all triangles lie within a millionth of the extent, and some are far away or have no area. */
static void crowded(int t, uint64_t *seed, double out[9]) {
  double size = t % 100 == 99 ? 1e3 : 1e-6;
  for (int k = 0; k < 9; k++) {
    out[k] = t % 10 == 3 ? out[k % 3] : size * uniform(seed);
  }
}

static double plain_search(int count, const double p[3], double bound, int32_t *found) {
  double best = bound, at[3];
  *found = -1;
  for (int t = 0; t < count; t++) {
    double d2 = orb_triangle_nearest(positions + 9 * t, p, at);
    if (d2 < best) {
      best = d2;
      *found = t;
    }
  }
  return *found >= 0 ? best : INFINITY;
}

/* The same triangle and the same bits, without a bound, with one, and from a place that is known. */
static void compare(const orb_nearest *tree, int count, const double p[3], uint64_t *seed) {
  int32_t wanted;
  orb_place found, known = {.triangle = (int32_t)(uniform(seed) * count)};
  double d2 = plain_search(count, p, INFINITY, &wanted);
  double known2 = orb_triangle_nearest(positions + 9 * known.triangle, p, known.at);
  assert_true(orb_nearest_query(tree, p, INFINITY, &found) == d2);
  assert_int_equal(found.triangle, wanted);
  assert_true(orb_nearest_query_from(tree, p, &known, known2, &found) == d2);
  assert_int_equal(found.triangle, wanted);
  assert_true(orb_nearest_query(tree, p, nextafter(d2, INFINITY), &found) == d2);
  assert_int_equal(found.triangle, wanted);
  assert_true(orb_nearest_query(tree, p, d2, &found) == INFINITY);
  assert_int_equal(found.triangle, -1);
}

static void a_plain_search_finds_the_same(void **state) {
  static const triangle_fn make[] = {scattered, gridded, repeated, crowded};
  static const int counts[] = {1, 2, 7, 8, 9, 63, 64, 65, 511, 513, MOST};
  uint64_t seed = 11;
  (void)state;
  for (int32_t i = 0; i < 3 * MOST; i++) {
    triangles[i] = i;
  }
  for (size_t m = 0; m < sizeof make / sizeof *make; m++) {
    for (int t = 0; t < MOST; t++) {
      make[m](t, &seed, positions + 9 * t);
    }
    for (size_t c = 0; c < sizeof counts / sizeof *counts; c++) {
      orb_nearest *tree;
      assert_int_equal(orb_nearest_create(ctx, positions, triangles, counts[c], &tree), ORB_OK);
      for (int q = 0; q < 60; q++) {
        double p[3], reach = q % 3 == 0 ? 1e-7 : q % 3 == 1 ? 1 : 1e6;
        const double *near = positions + 9 * (int)(uniform(&seed) * counts[c]);
        for (int k = 0; k < 3; k++) {
          p[k] = near[k] + (q % 2 ? reach * (uniform(&seed) - 0.5) : 0);
        }
        compare(tree, counts[c], p, &seed);
      }
      orb_nearest_destroy(ctx, tree);
    }
  }
}

static void no_triangles_have_no_nearest(void **state) {
  orb_nearest *tree;
  orb_place found;
  (void)state;
  assert_int_equal(orb_nearest_create(ctx, positions, triangles, 0, &tree), ORB_OK);
  assert_true(orb_nearest_query(tree, (double[3]){0, 0, 0}, 1, &found) == INFINITY);
  assert_int_equal(found.triangle, -1);
  orb_nearest_destroy(ctx, tree);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(no_point_of_a_grid_is_nearer),
      cmocka_unit_test(a_plain_search_finds_the_same),
      cmocka_unit_test(no_triangles_have_no_nearest),
  };
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
