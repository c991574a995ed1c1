/* Compares the locator with a search of every triangle. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "numeric/predicates.h"
#include "numeric/vec3.h"
#include "support_sphere.h"

typedef struct fixture {
  orb_context *ctx;
  orb_aligned_shape shape;
  orb_locator *locator;
} fixture;

static void setup(fixture *f, sphere_kind kind, int size, double jitter, unsigned seed) {
  assert_int_equal(orb_context_create(NULL, &f->ctx), ORB_OK);
  sphere_shape(f->ctx, kind, size, jitter, seed, &f->shape);
  assert_int_equal(orb_locator_create(f->ctx, f->shape.points, f->shape.mesh.vertex_count, f->shape.mesh.triangles,
                                      f->shape.mesh.triangle_count, NULL, &f->locator),
                   ORB_OK);
}

static void teardown(fixture *f) {
  orb_locator_destroy(f->ctx, f->locator);
  sphere_shape_free(f->ctx, &f->shape);
  assert_int_equal(orb_memory_used(f->ctx), 0);
  orb_context_destroy(f->ctx);
}

/* The lowest triangle that contains p, by exact tests of all. */
static int32_t search(const orb_aligned_shape *shape, const double p[3]) {
  for (int32_t t = 0; t < shape->mesh.triangle_count; t++) {
    const int32_t *c = shape->mesh.triangles + 3 * t;
    const double *a = shape->points + 3 * c[0], *b = shape->points + 3 * c[1], *d = shape->points + 3 * c[2];
    if (orb_orient(a, b, p) >= 0 && orb_orient(b, d, p) >= 0 && orb_orient(d, a, p) >= 0) {
      return t;
    }
  }
  fail_msg("no triangle holds the direction");
  return -1;
}

static void check_query(const fixture *f, const double p[3], int32_t hint) {
  orb_place place;
  orb_locate(f->locator, p, hint, &place);
  assert_int_equal(place.triangle, search(&f->shape, p));
  double q[3] = {0, 0, 0}, sum = 0;
  for (int k = 0; k < 3; k++) {
    assert_true(place.at[k] >= 0);
    sum += place.at[k];
    for (int j = 0; j < 3; j++) {
      q[j] += place.at[k] * f->shape.points[3 * f->shape.mesh.triangles[3 * place.triangle + k] + j];
    }
  }
  assert_true(fabs(sum - 1) < 1e-15);
  (void)orb_normalize(q);
  assert_true(orb_distance2(p, q) < 1e-28); /* the place is in direction p */
}

static void check_mesh(sphere_kind kind, int size, double jitter, unsigned seed) {
  fixture f;
  setup(&f, kind, size, jitter, seed);
  uint64_t state = 5;
  for (int i = 0; i < 400; i++) {
    double p[3];
    sphere_random(&state, p);
    check_query(&f, p, -1);
    check_query(&f, p, (int32_t)(sphere_uniform(&state) * f.shape.mesh.triangle_count));
  }
  teardown(&f);
}

static void finds_what_a_search_finds(void **state) {
  (void)state;
  check_mesh(SPHERE_TETRA, 0, 0, 0);
  check_mesh(SPHERE_TETRA, 0, 0, 3);
  check_mesh(SPHERE_OCTA, 3, 0, 0);
  check_mesh(SPHERE_ICO, 4, 0.3, 2);
  check_mesh(SPHERE_UV, 40, 0, 0);
}

static void vertices_are_exact(void **state) {
  (void)state;
  fixture f;
  setup(&f, SPHERE_UV, 24, 0, 0);
  for (int32_t v = 0; v < f.shape.mesh.vertex_count; v++) {
    orb_place place;
    const double *p = f.shape.points + 3 * v;
    orb_locate(f.locator, p, v % f.shape.mesh.triangle_count, &place);
    assert_int_equal(place.triangle, search(&f.shape, p));
    int found = 0;
    for (int k = 0; k < 3; k++) {
      if (f.shape.mesh.triangles[3 * place.triangle + k] == v) {
        assert_true(place.at[k] == 1 && place.at[(k + 1) % 3] == 0 && place.at[(k + 2) % 3] == 0);
        found = 1;
      }
    }
    assert_true(found);
  }
  teardown(&f);
}

/* Midpoints of the octahedron's edges lie on them exactly: 0 in one coordinate. */
static void edges_are_exact(void **state) {
  (void)state;
  fixture f;
  setup(&f, SPHERE_OCTA, 0, 0, 0);
  for (int32_t h = 0; h < 24; h++) {
    const double *a = f.shape.points + 3 * f.shape.mesh.triangles[h];
    const double *b = f.shape.points + 3 * f.shape.mesh.triangles[orb_next(h)];
    double p[3];
    for (int k = 0; k < 3; k++) {
      p[k] = a[k] + 2 * b[k];
    }
    (void)orb_normalize(p);
    for (int32_t hint = -1; hint < 8; hint++) {
      orb_place place;
      orb_locate(f.locator, p, hint, &place);
      assert_int_equal(place.triangle, search(&f.shape, p));
      int zeros = 0;
      for (int k = 0; k < 3; k++) {
        zeros += place.at[k] == 0;
      }
      assert_int_equal(zeros, 1);
    }
  }
  teardown(&f);
}

static void refuses_an_open_mesh(void **state) {
  (void)state;
  fixture f;
  setup(&f, SPHERE_OCTA, 1, 0, 0);
  orb_locator *locator = NULL;
  assert_int_not_equal(orb_locator_create(f.ctx, f.shape.points, f.shape.mesh.vertex_count, f.shape.mesh.triangles,
                                          f.shape.mesh.triangle_count - 1, NULL, &locator),
                       ORB_OK);
  assert_null(locator);
  teardown(&f);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(finds_what_a_search_finds),
      cmocka_unit_test(vertices_are_exact),
      cmocka_unit_test(edges_are_exact),
      cmocka_unit_test(refuses_an_open_mesh),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
