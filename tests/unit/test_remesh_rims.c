/* Rims of filled holes as edges of a supermesh, checked by the arcs of the shape itself. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"
#include "numeric/vec3.h"
#include "support_remesh.h"

enum { SAMPLES = 8 }; /* points of each arc of a rim */

/* Points on the unit sphere this near are the same: a hundred roundings. */
static const double SAME = 1e-14;
/* A point is this near to an edge that was made to run through it. Needles magnify the rounding. */
static const double ON = 1e-9;

static int32_t next(int32_t h) {
  return h % 3 == 2 ? h - 2 : h + 1;
}

/* Marks the triangles in two caps as if they had filled holes. */
static void make_holes(orb_context *ctx, orb_aligned_shape *shape) {
  static const double centre[2][3] = {{0, 0.6, 0.8}, {0.36, -0.48, -0.8}}, reach[2] = {0.8, 0.95};
  orb_mesh *mesh = &shape->mesh;
  mesh->source_triangle = ORB_NEW(ctx, int32_t, mesh->triangle_count);
  assert_non_null(mesh->source_triangle);
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    double middle[3] = {0, 0, 0};
    for (int32_t h = 3 * t; h < 3 * t + 3; h++) {
      for (int k = 0; k < 3; k++) {
        middle[k] += shape->points[3 * mesh->triangles[h] + k];
      }
    }
    orb_normalize(middle);
    const int filled = orb_dot(middle, centre[0]) > reach[0] || orb_dot(middle, centre[1]) > reach[1];
    mesh->source_triangle[t] = filled ? ORB_MADE_FILL : t;
  }
}

/* The distance of p from the arc between a and b. */
static double from_arc(const double p[3], const double a[3], const double b[3]) {
  double n[3], to_a[3], to_b[3];
  orb_cross(a, b, n);
  orb_normalize(n);
  orb_cross(a, p, to_a);
  orb_cross(p, b, to_b);
  if (orb_dot(to_a, n) >= 0 && orb_dot(to_b, n) >= 0) {
    return fabs(orb_dot(p, n));
  }
  return sqrt(fmin(orb_distance2(p, a), orb_distance2(p, b)));
}

/* The distance of p from the nearest edge of the supermesh. */
static double from_edges(const orb_supermesh *m, const double p[3]) {
  double least = INFINITY;
  for (int32_t h = 0; h < 3 * m->triangle_count; h++) {
    least = fmin(least, from_arc(p, m->points + 3 * m->triangles[h], m->points + 3 * m->triangles[next(h)]));
  }
  return least;
}

static double from_vertices(const orb_supermesh *m, const double p[3]) {
  double least = INFINITY;
  for (int32_t v = 0; v < m->vertex_count; v++) {
    least = fmin(least, orb_distance2(p, m->points + 3 * v));
  }
  return sqrt(least);
}

/* Each end of each arc of a rim is a vertex, and each point between them is on an edge. Returns the number of arcs. */
static int assert_rims(const orb_supermesh *m, const orb_aligned_shape *shape) {
  const orb_mesh *mesh = &shape->mesh;
  int arcs = 0;
  for (int32_t h = 0; h < 3 * mesh->triangle_count; h++) {
    for (int32_t g = 0; g < 3 * mesh->triangle_count && mesh->source_triangle[h / 3] == ORB_MADE_FILL; g++) {
      const int is_twin =
          mesh->triangles[g] == mesh->triangles[next(h)] && mesh->triangles[next(g)] == mesh->triangles[h];
      if (!is_twin || mesh->source_triangle[g / 3] == ORB_MADE_FILL) {
        continue;
      }
      const double *a = shape->points + 3 * mesh->triangles[h], *b = shape->points + 3 * mesh->triangles[next(h)];
      assert_true(from_vertices(m, a) < SAME);
      for (int i = 1; i < SAMPLES; i++) {
        double p[3];
        for (int k = 0; k < 3; k++) {
          p[k] = a[k] + (b[k] - a[k]) * i / SAMPLES;
        }
        orb_normalize(p);
        assert_true(from_edges(m, p) < ON);
      }
      arcs++;
    }
  }
  return arcs;
}

static void set_up(orb_context *ctx, unsigned seed, orb_aligned_shape shapes[2]) {
  sphere_shape(ctx, SPHERE_OCTA, 3, 0.2, seed, &shapes[0]);
  sphere_shape(ctx, SPHERE_ICO, 3, 0.2, seed + 20, &shapes[1]);
  make_holes(ctx, &shapes[0]);
}

static void tear_down(orb_context *ctx, orb_aligned_shape shapes[2]) {
  for (int s = 0; s < 2; s++) {
    orb_free(ctx, shapes[s].mesh.source_triangle);
    shapes[s].mesh.source_triangle = NULL;
    sphere_shape_free(ctx, &shapes[s]);
  }
}

static void rims_become_edges(void **state) {
  (void)state;
  static const orb_remesh_method method[] = {ORB_REMESH_ADAPTIVE, ORB_REMESH_SUBDIVISION, ORB_REMESH_CONVEX_HULL};
  for (int i = 0; i < 9; i++) {
    orb_context *ctx = remesh_context(2);
    orb_aligned_shape shapes[2];
    orb_supermesh m;
    orb_remesh_options options;
    set_up(ctx, (unsigned)i + 1, shapes);
    orb_remesh_defaults(&options);
    options.method = method[i % 3];
    options.tolerance = 0.01;
    options.rims = 1;
    assert_int_equal(orb_remesh(ctx, shapes, 2, 0, &options, &m), ORB_OK);
    assert_int_equal(m.has_rims, 1);
    sphere_assert_valid(&m, shapes, 2);
    assert_true(assert_rims(&m, &shapes[0]) > 20);
    for (int s = 0; s < 2 && options.method == ORB_REMESH_ADAPTIVE; s++) {
      assert_true(m.error_bound[s] <= options.tolerance * sphere_diagonal(&shapes[s]) * (1 + 1e-9));
    }
    orb_supermesh_free(ctx, &m);
    tear_down(ctx, shapes);
    orb_context_destroy(ctx);
  }
}

/* If the limit of triangles leaves no room for the rims, the result says so, and keeps the limit. */
static void no_room_for_rims(void **state) {
  (void)state;
  orb_context *ctx = remesh_context(2);
  orb_aligned_shape shapes[2];
  orb_supermesh m;
  orb_remesh_options options;
  set_up(ctx, 1, shapes);
  orb_remesh_defaults(&options);
  options.max_triangles = 20;
  options.rims = 1;
  assert_int_equal(orb_remesh(ctx, shapes, 2, 0, &options, &m), ORB_OK);
  assert_int_equal(m.has_rims, 0);
  assert_true(m.triangle_count <= 20);
  sphere_assert_valid(&m, shapes, 2);
  orb_supermesh_free(ctx, &m);
  tear_down(ctx, shapes);
  orb_context_destroy(ctx);
}

/* A first shape without filled holes has no rims; a later shape has none to give. */
static void only_the_first_shape_has_rims(void **state) {
  (void)state;
  orb_context *ctx = remesh_context(2);
  orb_aligned_shape shapes[2], turned[2];
  orb_supermesh m;
  orb_remesh_options options;
  set_up(ctx, 1, shapes);
  turned[0] = shapes[1];
  turned[1] = shapes[0];
  orb_remesh_defaults(&options);
  options.tolerance = 0.01;
  options.rims = 1;
  assert_int_equal(orb_remesh(ctx, turned, 2, 0, &options, &m), ORB_OK);
  assert_int_equal(m.has_rims, 0);
  orb_supermesh_free(ctx, &m);
  tear_down(ctx, shapes);
  orb_context_destroy(ctx);
}

/* Every allocation fails once; the call reports it and leaks nothing. */
static void fails_cleanly(void **state) {
  (void)state;
  int failures = 0;
  for (int64_t after = 0;; after += 1 + after / 8) {
    int64_t left = INT64_MAX;
    orb_context *ctx = remesh_failing_context(&left);
    orb_aligned_shape shapes[2];
    orb_supermesh m;
    orb_remesh_options options;
    set_up(ctx, 1, shapes);
    orb_remesh_defaults(&options);
    options.method = ORB_REMESH_CONVEX_HULL;
    options.rims = 1;
    left = after;
    orb_status status = orb_remesh(ctx, shapes, 2, 0, &options, &m);
    left = INT64_MAX;
    assert_true(status == ORB_OK || status == ORB_E_NO_MEMORY);
    failures += status != ORB_OK;
    if (status == ORB_OK) {
      assert_int_equal(m.has_rims, 1);
      orb_supermesh_free(ctx, &m);
    }
    tear_down(ctx, shapes);
    orb_context_destroy(ctx); /* asserts that all was freed */
    if (status == ORB_OK) {
      break;
    }
  }
  assert_true(failures > 10);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(rims_become_edges), cmocka_unit_test(no_room_for_rims),
                                     cmocka_unit_test(only_the_first_shape_has_rims), cmocka_unit_test(fails_cleanly)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
