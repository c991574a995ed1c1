/* The certificate of valid, flipped, degenerate, doubly covered and nearly flat embeddings. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "orbmorph/embed.h"
#include "support_context.h"
#include "support_exact.h"
#include "support_shapes.h"

static orb_certificate certify(const orb_mesh *mesh) {
  orb_certificate out;
  assert_int_equal(orb_certify(ctx, mesh->positions, mesh->vertex_count, mesh->triangles, mesh->triangle_count, &out),
                   ORB_OK);
  assert_true(out.exact);
  int64_t flipped = 0, flat = 0;
  for (int32_t t = 0; t < mesh->triangle_count; t++) { /* the counts are exact */
    const int32_t *v = mesh->triangles + 3 * t;
    int sign = exact_orientation(mesh->positions + 3 * v[0], mesh->positions + 3 * v[1], mesh->positions + 3 * v[2]);
    flipped += sign < 0;
    flat += sign == 0;
  }
  assert_int_equal(out.flipped, flipped);
  assert_int_equal(out.degenerate, flat);
  assert_int_equal(out.valid, flipped == 0 && flat == 0 && out.degree == 1);
  return out;
}

static void test_valid(void **unused) {
  (void)unused;
  orb_mesh list[] = {shape_tetrahedron(ctx), shape_octahedron(ctx), shape_icosahedron(ctx), shape_ball(ctx, 5),
                     shape_globe(ctx, 7, 9)};
  for (int i = 0; i < 5; i++) {
    orb_certificate c = certify(&list[i]);
    assert_true(c.valid);
    assert_int_equal(c.degree, 1);
    assert_true(c.min_determinant > 0);
    shape_free(ctx, &list[i]);
  }
}

static void test_smallest_determinant(void **unused) {
  (void)unused;
  orb_mesh mesh = shape_octahedron(ctx); /* each face spans an octant: determinant 1 */
  assert_true(fabs(certify(&mesh).min_determinant - 1) < 1e-15);
  shape_free(ctx, &mesh);
}

static void test_inside_out(void **unused) {
  (void)unused;
  orb_mesh mesh = shape_ball(ctx, 3);
  for (int32_t i = 0; i < 3 * mesh.vertex_count; i++) {
    mesh.positions[i] = -mesh.positions[i];
  }
  orb_certificate c = certify(&mesh);
  assert_false(c.valid);
  assert_int_equal(c.degree, -1);
  assert_int_equal(c.flipped, mesh.triangle_count);
  shape_free(ctx, &mesh);
}

/* One vertex pulled across its ring: some triangles flip, the degree stays. */
static void test_flipped(void **unused) {
  (void)unused;
  orb_mesh mesh = shape_ball(ctx, 3);
  double *p = mesh.positions + 3 * 40, angle = 0.6;
  double x = p[0], z = p[2];
  p[0] = cos(angle) * x - sin(angle) * z;
  p[2] = sin(angle) * x + cos(angle) * z;
  orb_certificate c = certify(&mesh);
  assert_false(c.valid);
  assert_true(c.flipped > 0 && c.flipped < mesh.triangle_count);
  assert_int_equal(c.degree, 1);
  shape_free(ctx, &mesh);
}

static void test_degenerate(void **unused) {
  (void)unused;
  orb_mesh mesh = shape_ball(ctx, 2);
  memcpy(mesh.positions, mesh.positions + 3 * mesh.triangles[1], 24); /* vertex 0 onto a neighbour */
  for (int32_t t = 0; t < mesh.triangle_count; t++) {
    if (mesh.triangles[3 * t] == 0) {
      memcpy(mesh.positions, mesh.positions + 3 * mesh.triangles[3 * t + 1], 24);
      break;
    }
  }
  orb_certificate c = certify(&mesh);
  assert_false(c.valid);
  assert_int_equal(c.degenerate, 2);
  shape_free(ctx, &mesh);
}

static void test_all_at_one_place(void **unused) {
  (void)unused;
  orb_mesh mesh = shape_ball(ctx, 2);
  for (int32_t i = 0; i < mesh.vertex_count; i++) {
    memcpy(mesh.positions + 3 * i, (double[]){0, 0.6, 0.8}, 24);
  }
  orb_certificate c = certify(&mesh);
  assert_int_equal(c.degenerate, mesh.triangle_count);
  assert_int_equal(c.degree, 0);
  shape_free(ctx, &mesh);
}

/* Doubled longitudes: every triangle is positive, and the sphere is covered twice. */
static void test_doubly_wrapped(void **unused) {
  (void)unused;
  for (int times = 2; times <= 3; times++) {
    orb_mesh mesh = shape_globe(ctx, 24, 11);
    for (int32_t i = 1; i < mesh.vertex_count - 1; i++) {
      double *p = mesh.positions + 3 * i, radius = hypot(p[0], p[1]), angle = times * atan2(p[1], p[0]);
      p[0] = radius * cos(angle);
      p[1] = radius * sin(angle);
    }
    orb_certificate c = certify(&mesh);
    assert_int_equal(c.flipped, 0);
    assert_int_equal(c.degenerate, 0);
    assert_int_equal(c.degree, times);
    assert_false(c.valid);
    shape_free(ctx, &mesh);
  }
}

/* Squeezed towards a great circle: valid in exact arithmetic until rounding flips triangles, and counted exactly. */
static void test_nearly_flat(void **unused) {
  (void)unused;
  for (int power = 0; power <= 60; power += 5) {
    orb_mesh mesh = shape_ball(ctx, 3);
    for (int32_t i = 0; i < mesh.vertex_count; i++) {
      double *p = mesh.positions + 3 * i, length;
      p[2] = ldexp(p[2], -power);
      length = sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
      for (int k = 0; k < 3; k++) {
        p[k] /= length;
      }
    }
    (void)certify(&mesh);
    shape_free(ctx, &mesh);
  }
}

static void test_same_for_any_threads(void **unused) {
  (void)unused;
  orb_mesh mesh = shape_ball(ctx, 6);
  orb_certificate first = certify(&mesh);
  for (int threads = 1; threads <= 4; threads += 3) {
    orb_context *other;
    orb_context_options options = {.threads = threads};
    assert_int_equal(orb_context_create(&options, &other), ORB_OK);
    orb_certificate c;
    assert_int_equal(orb_certify(other, mesh.positions, mesh.vertex_count, mesh.triangles, mesh.triangle_count, &c),
                     ORB_OK);
    assert_memory_equal(&c, &first, sizeof c);
    orb_context_destroy(other);
  }
  shape_free(ctx, &mesh);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_valid),
                                     cmocka_unit_test(test_smallest_determinant),
                                     cmocka_unit_test(test_inside_out),
                                     cmocka_unit_test(test_flipped),
                                     cmocka_unit_test(test_degenerate),
                                     cmocka_unit_test(test_all_at_one_place),
                                     cmocka_unit_test(test_doubly_wrapped),
                                     cmocka_unit_test(test_nearly_flat),
                                     cmocka_unit_test(test_same_for_any_threads)};
  return cmocka_run_group_tests(tests, context_two_threads, context_end);
}
