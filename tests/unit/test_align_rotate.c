/* Rotations: known ones (made here from quaternions, independently) are recovered, reflections are refused, shapes with
 * landmarks inside triangles and on edges keep their surface, and the error names contradictory landmarks. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "align/rotate/correlate.h"
#include "align/rotate/procrustes.h"
#include "align/rotate/rotate.h"
#include "base/memory.h"
#include "numeric/vec3.h"
#include "orbmorph/align.h"
#include "support_shapes.h"

static orb_context *make_context(int threads) {
  orb_context_options options = {.threads = threads};
  orb_context *ctx = NULL;
  assert_int_equal(orb_context_create(&options, &ctx), ORB_OK);
  return ctx;
}

/* v rotated by the unit quaternion q: v + 2w (u × v) + 2 u × (u × v). */
static void turn(const double q[4], const double v[3], double out[3]) {
  double a[3], b[3];
  orb_cross(q + 1, v, a);
  orb_cross(q + 1, a, b);
  for (int k = 0; k < 3; k++) {
    out[k] = v[k] + 2 * q[0] * a[k] + 2 * b[k];
  }
}

static const double QUATERNION[4] = {0.5, 0.7, -0.1, 0.5};

static void known_rotation_is_recovered(void **state) {
  (void)state;
  orb_context *ctx = make_context(1);
  double from[15] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0.6, 0.8, 0, 0, -0.6, 0.8}, to[15], rotation[9];
  for (int i = 0; i < 5; i++) {
    turn(QUATERNION, from + 3 * i, to + 3 * i);
  }
  assert_int_equal(orb_procrustes(ctx, from, to, 5, rotation, NULL), ORB_OK);
  for (int i = 0; i < 5; i++) {
    double p[3];
    orb_rotate_point(rotation, from + 3 * i, p);
    assert_true(orb_distance2(p, to + 3 * i) < 1e-28);
  }
  orb_context_destroy(ctx);
}

/* Three coplanar points and their mirror image in another plane: VUᵀ would be a reflection. */
static void reflection_gives_the_best_rotation(void **state) {
  (void)state;
  orb_context *ctx = make_context(1);
  double from[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, -0.6, 0.8, 0}, to[12], rotation[9];
  for (int i = 0; i < 4; i++) {
    double mirrored[3] = {from[3 * i], from[3 * i + 1], -from[3 * i + 2]};
    turn(QUATERNION, mirrored, to + 3 * i);
  }
  assert_int_equal(orb_procrustes(ctx, from, to, 4, rotation, NULL), ORB_OK);
  double determinant = orb_det(rotation, rotation + 3, rotation + 6), best = 0;
  assert_true(fabs(determinant - 1) < 1e-12);
  for (int i = 0; i < 4; i++) {
    double p[3];
    orb_rotate_point(rotation, from + 3 * i, p);
    best += orb_distance2(p, to + 3 * i);
  }
  /* No rotation of a dense sample is better. */
  for (int k = 0; k < 3000; k++) {
    double q[4] = {sin(k * 1.1), sin(k * 1.7 + 1), sin(k * 2.3 + 2), sin(k * 3.1 + 3)}, other = 0;
    double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int j = 0; j < 4; j++) {
      q[j] /= length;
    }
    for (int i = 0; i < 4; i++) {
      double p[3];
      turn(q, from + 3 * i, p);
      other += orb_distance2(p, to + 3 * i);
    }
    assert_true(other > best - 1e-12);
  }
  orb_context_destroy(ctx);
}

static void three_shapes_gather(void **state) {
  (void)state;
  orb_context *ctx = make_context(1);
  double points[3 * 12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, -0.6, 0, 0.8}, rotations[27], means[12];
  const double other[4] = {0.1, 0.7, 0.7, 0.1};
  for (int i = 0; i < 4; i++) {
    turn(QUATERNION, points + 3 * i, points + 12 + 3 * i);
    turn(other, points + 3 * i, points + 24 + 3 * i);
  }
  assert_int_equal(orb_procrustes_all(ctx, points, 3, 4, rotations, means), ORB_OK);
  for (int s = 0; s < 3; s++) {
    for (int i = 0; i < 4; i++) {
      double p[3];
      orb_rotate_point(rotations + 9 * s, points + 12 * s + 3 * i, p);
      assert_true(orb_distance2(p, means + 3 * i) < 1e-20);
      assert_true(orb_distance2(p, points + 3 * i) < 1e-20);
    }
  }
  orb_context_destroy(ctx);
}

/* An asymmetric star-shaped body: its central projection is an embedding. */
static orb_mesh make_body(orb_context *ctx, double **points) {
  orb_mesh mesh = shape_globe(ctx, 24, 16);
  *points = ORB_NEW(ctx, double, 3 * (size_t)mesh.vertex_count);
  assert_non_null(*points);
  memcpy(*points, mesh.positions, 3 * (size_t)mesh.vertex_count * sizeof(double));
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    double *x = mesh.positions + 3 * v, r = 1 + 0.4 * x[0] + 0.3 * x[1] * x[2] + 0.2 * x[1];
    x[0] *= 2 * r;
    x[1] *= r;
    x[2] *= 0.7 * r;
  }
  return mesh;
}

static void search_finds_the_rotation(void **state) {
  (void)state;
  orb_context *ctx = make_context(1);
  double *points, *rotated;
  orb_mesh mesh = make_body(ctx, &points);
  rotated = ORB_NEW(ctx, double, 3 * (size_t)mesh.vertex_count);
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    turn(QUATERNION, points + 3 * v, rotated + 3 * v);
    orb_normalize(rotated + 3 * v);
  }
  orb_align_shape shapes[2] = {{&mesh, points}, {&mesh, rotated}};
  orb_align_options options;
  orb_align_defaults(&options);
  options.method = ORB_ALIGN_ROTATE;
  orb_alignment out;
  assert_int_equal(orb_align(ctx, shapes, 2, NULL, 0, &options, &out), ORB_OK);
  double worst = 0;
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    double d = orb_distance2(out.shapes[0].points + 3 * v, out.shapes[1].points + 3 * v);
    worst = d > worst ? d : worst;
  }
  assert_true(sqrt(worst) < 0.1);
  assert_true(out.shapes[1].certificate.valid);
  orb_alignment_free(ctx, &out);
  orb_free(ctx, points);
  orb_free(ctx, rotated);
  shape_free(ctx, &mesh);
  orb_context_destroy(ctx);
}

static double area_of(const orb_mesh *mesh) {
  orb_extent extent;
  orb_mesh_extent(mesh, &extent);
  return extent.area;
}

/* Landmarks in one triangle, on one edge from both sides, and at a vertex become vertices at their places. */
static void landmarks_become_vertices(void **state) {
  (void)state;
  orb_context *ctx = make_context(1);
  double *points;
  orb_mesh mesh = make_body(ctx, &points);
  int32_t *twin = ORB_NEW(ctx, int32_t, 3 * (size_t)mesh.triangle_count);
  assert_int_equal(orb_mesh_twins(ctx, mesh.triangles, mesh.triangle_count, mesh.vertex_count, twin), ORB_OK);
  int32_t across = twin[3 * 100];
  orb_place at[6] = {{100, {0.2, 0.3, 0.5}}, {100, {0.5, 0.25, 0.25}}, {100, {0.4, 0.6, 0}},
                     {100, {0, 0, 1}},       {across / 3, {0, 0, 0}},  {100, {0.45, 0.3, 0.25}}};
  at[4].at[across % 3] = 0.3;
  at[4].at[(across + 1) % 3] = 0.7;
  orb_landmark landmarks[6];
  memset(landmarks, 0, sizeof landmarks);
  for (int k = 0; k < 6; k++) {
    landmarks[k].at = &at[k];
  }
  orb_align_shape shape = {&mesh, points};
  orb_align_options options;
  orb_align_defaults(&options);
  options.method = ORB_ALIGN_ROTATE;
  orb_alignment out;
  assert_int_equal(orb_align(ctx, &shape, 1, landmarks, 6, &options, &out), ORB_OK);
  orb_aligned_shape *made = &out.shapes[0];
  assert_int_equal(made->mesh.vertex_count, mesh.vertex_count + 5);
  assert_int_equal(made->mesh.triangle_count, 2 * made->mesh.vertex_count - 4);
  assert_true(made->certificate.valid);
  assert_true(fabs(area_of(&made->mesh) / area_of(&mesh) - 1) < 1e-12);
  for (int k = 0; k < 6; k++) {
    double x[3];
    orb_place_position(&mesh, &at[k], x);
    assert_true(orb_distance2(x, made->mesh.positions + 3 * made->landmark_vertices[k]) < 1e-24);
  }
  /* Every piece lies in its parent's plane and box: its corners are convex combinations of the parent's. */
  for (int32_t t = 0; t < made->mesh.triangle_count; t++) {
    const int32_t *corner = mesh.triangles + 3 * made->parent[t];
    double u[3], w[3], n[3];
    orb_sub(mesh.positions + 3 * corner[1], mesh.positions + 3 * corner[0], u);
    orb_sub(mesh.positions + 3 * corner[2], mesh.positions + 3 * corner[0], w);
    orb_cross(u, w, n);
    orb_normalize(n);
    for (int k = 0; k < 3; k++) {
      double d[3];
      orb_sub(made->mesh.positions + 3 * made->mesh.triangles[3 * t + k], mesh.positions + 3 * corner[0], d);
      assert_true(fabs(orb_dot(d, n)) < 1e-12);
    }
  }
  orb_alignment_free(ctx, &out);
  orb_free(ctx, twin);
  orb_free(ctx, points);
  shape_free(ctx, &mesh);
  orb_context_destroy(ctx);
}

static void bad_places_are_named(void **state) {
  (void)state;
  orb_context *ctx = make_context(1);
  double *points;
  orb_mesh mesh = make_body(ctx, &points);
  orb_align_shape shapes[2] = {{&mesh, points}, {&mesh, points}};
  orb_align_options options;
  orb_align_defaults(&options);
  orb_place good[2] = {{10, {1, 0, 0}}, {20, {1, 0, 0}}}, same[2] = {{10, {1, 0, 0}}, {40, {0, 1, 0}}},
            outside[2] = {{10, {0, 1, 0}}, {mesh.triangle_count, {1, 0, 0}}},
            negative[2] = {{11, {1, 0.5, -0.5}}, {50, {1, 0, 0}}};
  struct {
    const orb_place *second;
    int count, named, shape;
  } cases[3] = {{same, 2, 0, 0}, {outside, 1, 1, 1}, {negative, 1, 1, 0}};
  for (int c = 0; c < 3; c++) {
    orb_landmark landmarks[2];
    memset(landmarks, 0, sizeof landmarks);
    landmarks[0].at = good;
    landmarks[1].at = cases[c].second;
    orb_alignment out;
    assert_int_equal(orb_align(ctx, shapes, 2, landmarks, 2, &options, &out), ORB_E_BAD_LANDMARKS);
    const orb_error *error = orb_context_error(ctx);
    assert_int_equal(error->landmark_count, cases[c].count);
    assert_int_equal(error->landmarks[0], cases[c].named);
    assert_int_equal(error->shape, cases[c].shape);
  }
  orb_alignment out;
  assert_int_equal(orb_align(ctx, shapes, 2, NULL, 0, &options, &out), ORB_E_BAD_OPTION);
  orb_free(ctx, points);
  shape_free(ctx, &mesh);
  orb_context_destroy(ctx);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(known_rotation_is_recovered), cmocka_unit_test(reflection_gives_the_best_rotation),
      cmocka_unit_test(three_shapes_gather),         cmocka_unit_test(search_finds_the_rotation),
      cmocka_unit_test(landmarks_become_vertices),   cmocka_unit_test(bad_places_are_named),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
