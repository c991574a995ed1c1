/* Unfolding a level by collapses: whichever parts were folded, no triangle is flipped afterwards. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "align/map/engine/unfold.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"
#include "support_shapes.h"

/* A ball whose points on the sphere are its own, until a test folds them. */
typedef struct ball {
  orb_context *ctx;
  orb_mesh mesh;
  orb_map_level level;
} ball;

static uint32_t seed;

static double chance(void) {
  seed = seed * 1664525U + 1013904223U;
  return seed / 4294967296.0;
}

static void make(ball *b) {
  seed = 20161;
  assert_int_equal(orb_context_create(NULL, &b->ctx), ORB_OK);
  b->mesh = shape_ball(b->ctx, 4);
  size_t n = (size_t)b->mesh.vertex_count;
  b->level = (orb_map_level){.count = b->mesh.vertex_count,
                             .triangle_count = b->mesh.triangle_count,
                             .triangle = b->mesh.triangles,
                             .x = malloc(3 * n * sizeof(double)),
                             .pinned = calloc(n, 1)};
  assert_true(b->level.x && b->level.pinned);
  memcpy(b->level.x, b->mesh.positions, 3 * n * sizeof(double));
}

static void drop(ball *b) {
  free(b->level.x);
  free(b->level.pinned);
  shape_free(b->ctx, &b->mesh);
  orb_context_destroy(b->ctx);
}

/* Moves the points within `reach` of a pole by up to `size` in each coordinate. */
static void crumple(ball *b, double reach, double size) {
  for (int32_t v = 0; v < b->level.count; v++) {
    double *x = b->level.x + 3 * (size_t)v;
    if (x[2] > cos(reach) && !b->level.pinned[v]) {
      for (int k = 0; k < 3; k++) {
        x[k] += size * (chance() - 0.5);
      }
      orb_normalize(x);
    }
  }
}

/* Flipped triangles, by the exact predicate. */
static int32_t flips(const ball *b) {
  int32_t count = 0;
  for (int32_t t = 0; t < b->level.triangle_count; t++) {
    const int32_t *v = b->level.triangle + 3 * (size_t)t;
    const double *x = b->level.x;
    count += orb_orient(x + 3 * (size_t)v[0], x + 3 * (size_t)v[1], x + 3 * (size_t)v[2]) <= 0;
  }
  return count;
}

/* beside: how far from the folds vertices may move. */
static void unfolds(double reach, double size, int pin_every, double beside) {
  ball b;
  make(&b);
  for (int32_t v = 0; v < b.level.count && pin_every; v += pin_every) {
    b.level.pinned[v] = 1;
  }
  crumple(&b, reach, size);
  size_t bytes = 3 * (size_t)b.level.count * sizeof(double);
  double *before = malloc(bytes);
  assert_non_null(before);
  memcpy(before, b.level.x, bytes);
  int32_t left = -1;
  assert_true(flips(&b) > 0);
  assert_int_equal(orb_map_level_unfold(b.ctx, &b.level, &left), ORB_OK);
  assert_int_equal(left, 0);
  assert_int_equal(flips(&b), 0);
  int32_t moved = 0;
  for (int32_t v = 0; v < b.level.count; v++) {
    const double *x = b.level.x + 3 * (size_t)v;
    int same = memcmp(x, before + 3 * (size_t)v, sizeof(double[3])) == 0;
    assert_true(same || !b.level.pinned[v]);
    assert_true(same || x[2] > cos(reach + beside));
    assert_true(fabs(orb_dot(x, x) - 1) < 1e-12);
    moved += !same;
  }
  assert_true(moved > 0);
  free(before);
  drop(&b);
}

static void few_flips(void **state) {
  (void)state;
  unfolds(0.3, 0.12, 0, 0.5);
}

static void crumpled_cap(void **state) {
  (void)state;
  unfolds(0.5, 0.25, 0, 0.5);
}

static void around_pinned_vertices(void **state) {
  (void)state;
  unfolds(0.4, 0.15, 37, 0.5);
}

/* A third of the ball, torn so far that kernels within kernels have no room in doubles unless they are relaxed. */
static void large_fold(void **state) {
  (void)state;
  unfolds(1.2, 1.5, 0, 1);
}

/* The marked vertices come back, and pinned ones around them stay. */
static void set_anew(void **state) {
  (void)state;
  ball b;
  make(&b);
  const size_t n = (size_t)b.level.count;
  unsigned char *mark = calloc(n, 1);
  int32_t moved = 0, marked = 0;
  assert_non_null(mark);
  for (size_t v = 0; v < n; v++) {
    mark[v] = b.mesh.positions[3 * v + 2] > 0.7;
    b.level.pinned[v] = !mark[v];
  }
  assert_int_equal(orb_map_level_set_anew(b.ctx, &b.level, mark), ORB_OK);
  assert_int_equal(flips(&b), 0);
  for (size_t v = 0; v < n; v++) {
    const int same = memcmp(b.level.x + 3 * v, b.mesh.positions + 3 * v, sizeof(double[3])) == 0;
    assert_true(same || mark[v]);
    moved += !same;
    marked += mark[v];
  }
  assert_true(moved > marked / 2);
  free(mark);
  drop(&b);
}

static void nothing_flipped(void **state) {
  (void)state;
  ball b;
  make(&b);
  int32_t left = -1;
  assert_int_equal(orb_map_level_unfold(b.ctx, &b.level, &left), ORB_OK);
  assert_int_equal(left, 0);
  assert_memory_equal(b.level.x, b.mesh.positions, 3 * (size_t)b.level.count * sizeof(double));
  drop(&b);
}

/* Two neighbours that are pinned at each other's places cannot be unfolded: the level stays as it was. */
static void pinned_folds_remain(void **state) {
  (void)state;
  ball b;
  make(&b);
  const int32_t *v = b.level.triangle;
  double *p = b.level.x + 3 * (size_t)v[0], *q = b.level.x + 3 * (size_t)v[1], old[3];
  memcpy(old, p, sizeof old);
  memcpy(p, q, sizeof old);
  memcpy(q, old, sizeof old);
  memset(b.level.pinned, 1, (size_t)b.level.count);
  int32_t left = -1, there = flips(&b);
  assert_true(there > 0);
  assert_int_equal(orb_map_level_unfold(b.ctx, &b.level, &left), ORB_OK);
  assert_int_equal(left, there);
  assert_memory_equal(p, b.mesh.positions + 3 * (size_t)v[1], sizeof old);
  drop(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(few_flips),           cmocka_unit_test(crumpled_cap), cmocka_unit_test(around_pinned_vertices),
      cmocka_unit_test(large_fold),          cmocka_unit_test(set_anew),     cmocka_unit_test(nothing_flipped),
      cmocka_unit_test(pinned_folds_remain),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
