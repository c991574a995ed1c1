/* What untangling has only spread is put back, part by part. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "align/map/engine/folds.h"
#include "numeric/vec3.h"
#include "support_shapes.h"

/* A ball whose points on the sphere are its own, until a test moves them. */
typedef struct ball {
  orb_context *ctx;
  orb_mesh mesh;
  orb_map_level level;
} ball;

/* The spokes of each vertex, in any order. */
static void fill_spokes(orb_map_level *l) {
  for (int32_t h = 0; h < 3 * l->triangle_count; h++) {
    l->start[l->triangle[h] + 1]++;
  }
  for (int32_t v = 0; v < l->count; v++) {
    l->start[v + 1] += l->start[v];
  }
  int32_t *next = calloc((size_t)l->count, sizeof *next);
  assert_non_null(next);
  for (int32_t h = 0; h < 3 * l->triangle_count; h++) {
    const int32_t *t = l->triangle + 3 * (size_t)(h / 3), v = t[h % 3];
    l->spoke[l->start[v] + next[v]++] = (orb_map_spoke){.q = t[(h + 1) % 3], .r = t[(h + 2) % 3]};
  }
  free(next);
}

static void make(ball *b) {
  assert_int_equal(orb_context_create(NULL, &b->ctx), ORB_OK);
  b->mesh = shape_ball(b->ctx, 4);
  const size_t n = (size_t)b->mesh.vertex_count, triangles = (size_t)b->mesh.triangle_count;
  b->level = (orb_map_level){.count = b->mesh.vertex_count,
                             .triangle_count = b->mesh.triangle_count,
                             .triangle = b->mesh.triangles,
                             .start = calloc(n + 1, sizeof(int32_t)),
                             .spoke = calloc(3 * triangles, sizeof(orb_map_spoke)),
                             .x = malloc(3 * n * sizeof(double))};
  assert_true(b->level.start && b->level.spoke && b->level.x);
  fill_spokes(&b->level);
  memcpy(b->level.x, b->mesh.positions, 3 * n * sizeof(double));
}

static void drop(ball *b) {
  free(b->level.start);
  free(b->level.spoke);
  free(b->level.x);
  shape_free(b->ctx, &b->mesh);
  orb_context_destroy(b->ctx);
}

/* Rotates the points of the upper cap by a small angle that falls to 0 at its rim: nothing is flipped. */
static void twist_cap(ball *b) {
  for (int32_t v = 0; v < b->level.count; v++) {
    double *x = b->level.x + 3 * (size_t)v;
    const double angle = 0.3 * (x[2] - 0.7), c = cos(angle), s = sin(angle), old[2] = {x[0], x[1]};
    if (angle > 0) {
      x[0] = c * old[0] - s * old[1];
      x[1] = s * old[0] + c * old[1];
    }
  }
}

/* Mirrors the points of the lower cap: everything there is flipped. */
static void mirror_cap(ball *b) {
  for (int32_t v = 0; v < b->level.count; v++) {
    double *x = b->level.x + 3 * (size_t)v;
    x[0] = x[2] < -0.7 ? -x[0] : x[0];
  }
}

static void puts_back_what_is_folded(void **state) {
  (void)state;
  ball b;
  make(&b);
  twist_cap(&b);
  mirror_cap(&b);
  int32_t flips = -1, kept = 0, folded = 0;
  assert_true(orb_map_level_flips(&b.level) > 0);
  assert_int_equal(orb_map_level_restore_folds(b.ctx, &b.level, b.mesh.positions, &flips), ORB_OK);
  assert_int_equal(flips, 0);
  for (int32_t v = 0; v < b.level.count; v++) {
    const double *x = b.level.x + 3 * (size_t)v, *given = b.mesh.positions + 3 * (size_t)v;
    const int same = memcmp(x, given, sizeof(double[3])) == 0;
    folded += given[2] < -0.7;
    assert_true(same || given[2] > 0.7);
    kept += !same;
  }
  assert_true(folded > 10);
  assert_true(kept > 10);
  drop(&b);
}

/* A vertex that was flipped before and has not moved is nobody's part: it stays, and counts. */
static void counts_what_has_not_moved(void **state) {
  (void)state;
  ball b;
  make(&b);
  mirror_cap(&b);
  const size_t size = 3 * (size_t)b.level.count * sizeof(double);
  double *before = malloc(size);
  assert_non_null(before);
  memcpy(before, b.level.x, size);
  const int32_t there = orb_map_level_flips(&b.level);
  twist_cap(&b);
  double *moved = malloc(size);
  assert_non_null(moved);
  memcpy(moved, b.level.x, size);
  int32_t flips = -1;
  assert_int_equal(orb_map_level_restore_folds(b.ctx, &b.level, before, &flips), ORB_OK);
  assert_true(there > 0);
  assert_int_equal(flips, there);
  assert_memory_equal(b.level.x, moved, size);
  free(before);
  free(moved);
  drop(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(puts_back_what_is_folded),
      cmocka_unit_test(counts_what_has_not_moved),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
