/* What a pose tells beside its bend, where geometry gives the numbers. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "align/find/evidence.h"
#include "base/memory.h"
#include "support_context.h"
#include "support_shapes.h"

typedef struct scene {
  orb_mesh mesh; /* a ball: its normals are spread evenly */
  orb_nearest *tree;
  double *pose;
} scene;

static scene scene_open(void) {
  scene s = {.mesh = shape_ball(ctx, 4)};
  s.pose = orb_alloc(ctx, 3 * (size_t)s.mesh.vertex_count, sizeof(double));
  assert_non_null(s.pose);
  assert_int_equal(orb_nearest_create(ctx, s.mesh.positions, s.mesh.triangles, s.mesh.triangle_count, &s.tree), ORB_OK);
  return s;
}

static void scene_close(scene *s) {
  orb_nearest_destroy(ctx, s->tree);
  orb_free(ctx, s->pose);
  shape_free(ctx, &s->mesh);
}

/* Puts each vertex to the matrix m, row-major, times its place. */
static void pose_by(scene *s, const double m[9]) {
  for (int32_t v = 0; v < s->mesh.vertex_count; v++) {
    const double *x = s->mesh.positions + 3 * (size_t)v;
    for (int k = 0; k < 3; k++) {
      s->pose[3 * (size_t)v + (size_t)k] = m[3 * k] * x[0] + m[3 * k + 1] * x[1] + m[3 * k + 2] * x[2];
    }
  }
}

static void assert_near(double value, double expected, double apart) {
  assert_true(fabs(value - expected) <= apart);
}

static double scattered(const scene *s) {
  return orb_evidence_scattered(&s->mesh, s->pose, &s->mesh, s->tree);
}

static void a_quarter_turn_is_a_rotation_and_nothing_else(void **state) {
  (void)state;
  scene s = scene_open();
  pose_by(&s, (double[]){0, -1, 0, 1, 0, 0, 0, 0, 1});
  assert_near(orb_evidence_rotated(&s.mesh, s.pose), 0.5, 1e-9);
  assert_near(orb_evidence_resized(&s.mesh, s.pose), 0, 1e-9);
  assert_near(scattered(&s), 0, 1e-9); /* the turn takes the ball's triangles onto each other */
  scene_close(&s);
}

/* Twice as long is four times as large. */
static void areas_count_by_their_ratio(void **state) {
  (void)state;
  scene s = scene_open();
  pose_by(&s, (double[]){2, 0, 0, 0, 2, 0, 0, 0, 2});
  assert_near(orb_evidence_resized(&s.mesh, s.pose), log(4), 1e-9);
  pose_by(&s, (double[]){0.5, 0, 0, 0, 0.5, 0, 0, 0, 0.5});
  assert_near(orb_evidence_resized(&s.mesh, s.pose), log(4), 1e-9);
  assert_near(orb_evidence_rotated(&s.mesh, s.pose), 0, 1e-6);
  scene_close(&s);
}

/* A triangle that has collapsed counts as a small one, not as infinitely small. */
static void collapsed_triangles_count_as_small_ones(void **state) {
  (void)state;
  scene s = scene_open();
  pose_by(&s, (double[9]){0});
  const double most = orb_evidence_resized(&s.mesh, s.pose);
  assert_true(isfinite(most) && most > log(10));
  scene_close(&s);
}

/* Each normal meets the opposite one. Mirrored at a plane, the mean cosine of a ball's normals is −1/3 + 2/3, and no
 * rotation makes it more: reflections are none. */
static void opposite_normals_are_scattered(void **state) {
  (void)state;
  scene s = scene_open();
  pose_by(&s, (double[]){-1, 0, 0, 0, -1, 0, 0, 0, -1});
  assert_near(scattered(&s), 2.0 / 3, 0.01);
  pose_by(&s, (double[]){1, 0, 0, 0, 1, 0, 0, 0, -1});
  assert_near(scattered(&s), 2.0 / 3, 0.01);
  scene_close(&s);
}

/* The half below z = 0 lies mirrored on the half above. Then the normal's z there is |z| here, and the sum of there
 * hereᵀ is diag(1/3, 1/3, 0) times the area. */
static void a_ball_folded_onto_its_half_is_scattered(void **state) {
  (void)state;
  scene s = scene_open();
  for (int32_t v = 0; v < s.mesh.vertex_count; v++) {
    const double *x = s.mesh.positions + 3 * (size_t)v;
    s.pose[3 * (size_t)v] = x[0];
    s.pose[3 * (size_t)v + 1] = x[1];
    s.pose[3 * (size_t)v + 2] = fabs(x[2]);
  }
  assert_near(scattered(&s), 1 - 2.0 / 3, 0.02);
  scene_close(&s);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_quarter_turn_is_a_rotation_and_nothing_else), cmocka_unit_test(areas_count_by_their_ratio),
      cmocka_unit_test(collapsed_triangles_count_as_small_ones),       cmocka_unit_test(opposite_normals_are_scattered),
      cmocka_unit_test(a_ball_folded_onto_its_half_is_scattered),
  };
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
