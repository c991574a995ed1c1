/* The convex hull: every input vertex is a vertex, no vertex lies beyond a facet's plane, T = 2V − 4; coincident,
 * nearly coincident and cocircular points; a repeat gives the same bytes; lack of memory is a clean error. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "numeric/vec3.h"
#include "remesh/qhull.h"
#include "support_sphere.h"

static orb_context *make_context(int threads, size_t memory) {
  orb_context *ctx;
  orb_context_options options = {.threads = threads, .memory_limit = memory};
  assert_int_equal(orb_context_create(&options, &ctx), ORB_OK);
  return ctx;
}

static orb_status hull(orb_context *ctx, const orb_aligned_shape *shapes, int count, int64_t most, orb_supermesh *out) {
  orb_remesh_options options;
  orb_remesh_defaults(&options);
  options.method = ORB_REMESH_CONVEX_HULL;
  options.max_triangles = most;
  return orb_remesh(ctx, shapes, count, 0, &options, out);
}

static void assert_all_vertices(const orb_supermesh *m, const orb_aligned_shape *shapes, int count) {
  for (int s = 0; s < count; s++) {
    const orb_mesh *mesh = &shapes[s].mesh;
    int32_t met = 0;
    unsigned char *seen = calloc((size_t)mesh->vertex_count, 1);
    assert_non_null(seen);
    for (int32_t v = 0; v < m->vertex_count; v++) {
      const orb_place *p = &m->places[(size_t)s * (size_t)m->vertex_count + (size_t)v];
      for (int k = 0; k < 3; k++) {
        int32_t w = mesh->triangles[3 * p->triangle + k];
        if (p->at[k] == 1 && !seen[w]) {
          seen[w] = 1;
          met++;
        }
      }
    }
    free(seen);
    assert_int_equal(met, mesh->vertex_count);
  }
}

/* No vertex lies beyond the plane of a facet, by brute force, within the rounding of points on the unit sphere. Needles
 * between nearly coincident points have no meaningful plane. */
static void assert_convex(const orb_supermesh *m, int every) {
  for (int32_t t = 0; t < m->triangle_count; t += every) {
    double u[3], v[3], n[3], d[3];
    const double *a = m->points + 3 * m->triangles[3 * t];
    orb_sub(m->points + 3 * m->triangles[3 * t + 1], a, u);
    orb_sub(m->points + 3 * m->triangles[3 * t + 2], a, v);
    orb_cross(u, v, n);
    double size = orb_length(n);
    if (size < 1e-5 * fmax(orb_dot(u, u), orb_dot(v, v))) {
      continue;
    }
    for (int32_t w = 0; w < m->vertex_count; w++) {
      orb_sub(m->points + 3 * w, a, d);
      assert_true(orb_dot(n, d) <= 1e-8 * size);
    }
  }
}

static void check(orb_context *ctx, const orb_aligned_shape *shapes, int count, int32_t vertices) {
  orb_supermesh m;
  orb_status status = hull(ctx, shapes, count, 0, &m);
  if (status != ORB_OK) {
    print_message("%s: %s\n", orb_status_name(status), orb_context_error(ctx)->detail);
  }
  assert_int_equal(status, ORB_OK);
  sphere_assert_valid(&m, shapes, count);
  assert_all_vertices(&m, shapes, count);
  assert_convex(&m, 1 + m.triangle_count / 500);
  assert_int_equal(m.triangle_count, 2 * m.vertex_count - 4);
  if (vertices > 0) {
    assert_int_equal(m.vertex_count, vertices);
  }
  for (int s = 0; s < count; s++) {
    assert_true(m.error_bound[s] >= 0 && m.error_bound[s] < 0.5 * sphere_diagonal(&shapes[s]));
  }
  orb_supermesh_free(ctx, &m);
}

static void pair(sphere_kind a, int a_size, unsigned a_seed, sphere_kind b, int b_size, unsigned b_seed, double jitter,
                 int shared) {
  orb_context *ctx = make_context(2, 0);
  orb_aligned_shape shapes[2];
  sphere_shape(ctx, a, a_size, jitter, a_seed, &shapes[0]);
  sphere_shape(ctx, b, b_size, jitter, b_seed, &shapes[1]);
  int32_t vertices = shapes[0].mesh.vertex_count + shapes[1].mesh.vertex_count - shared;
  check(ctx, shapes, 2, shared < 0 ? 0 : vertices);
  sphere_shape_free(ctx, &shapes[0]);
  sphere_shape_free(ctx, &shapes[1]);
  orb_context_destroy(ctx);
}

static void general_position(void **state) {
  (void)state;
  pair(SPHERE_ICO, 3, 1, SPHERE_OCTA, 3, 2, 0.2, 0);
  pair(SPHERE_UV, 20, 3, SPHERE_ICO, 3, 2, 0.1, 0);
  pair(SPHERE_TETRA, 0, 1, SPHERE_TETRA, 0, 3, 0, 0);
  pair(SPHERE_ICO, 5, 1, SPHERE_ICO, 5, 2, 0.2, 0);
}

/* Coincident points become one vertex; the 6 of an octahedron are among the 18 of its four-way split. */
static void coincident(void **state) {
  (void)state;
  pair(SPHERE_ICO, 3, 4, SPHERE_ICO, 3, 4, 0.2, 642);
  pair(SPHERE_TETRA, 0, 0, SPHERE_TETRA, 0, 0, 0, 4);
  pair(SPHERE_OCTA, 0, 0, SPHERE_OCTA, 1, 0, 0, 6);
}

/* Rings of cocircular points, poles and meridians in common up to rounding. */
static void cocircular(void **state) {
  (void)state;
  pair(SPHERE_UV, 16, 0, SPHERE_UV, 16, 0, 0, -1);
  pair(SPHERE_OCTA, 3, 0, SPHERE_UV, 16, 0, 0, -1);
  pair(SPHERE_OCTA, 2, 0, SPHERE_OCTA, 4, 0, 0, -1);
  pair(SPHERE_UV, 8, 0, SPHERE_UV, 24, 0, 0, -1);
}

/* A second shape whose points are those of the first, moved by a few roundings: far below Qhull's tolerances. */
static void nearly_coincident(void **state) {
  (void)state;
  orb_context *ctx = make_context(1, 0);
  orb_aligned_shape shapes[2];
  uint64_t seed = 7;
  for (int s = 0; s < 2; s++) {
    sphere_shape(ctx, SPHERE_ICO, 3, 0.2, 5, &shapes[s]);
  }
  for (int32_t i = 0; i < 3 * shapes[1].mesh.vertex_count; i++) {
    shapes[1].points[i] += 1e-14 * (sphere_uniform(&seed) - 0.5);
  }
  check(ctx, shapes, 2, 2 * 642);
  sphere_shape_free(ctx, &shapes[0]);
  sphere_shape_free(ctx, &shapes[1]);
  orb_context_destroy(ctx);
}

static void same_bytes(void **state) {
  (void)state;
  orb_supermesh m[2];
  orb_context *ctx[2];
  for (int i = 0; i < 2; i++) {
    orb_aligned_shape shapes[2];
    ctx[i] = make_context(i ? 4 : 1, 0);
    sphere_shape(ctx[i], SPHERE_ICO, 4, 0.2, 1, &shapes[0]);
    sphere_shape(ctx[i], SPHERE_UV, 24, 0, 0, &shapes[1]);
    assert_int_equal(hull(ctx[i], shapes, 2, 0, &m[i]), ORB_OK);
    sphere_shape_free(ctx[i], &shapes[0]);
    sphere_shape_free(ctx[i], &shapes[1]);
  }
  assert_int_equal(m[0].vertex_count, m[1].vertex_count);
  assert_memory_equal(m[0].points, m[1].points, 3 * (size_t)m[0].vertex_count * sizeof(double));
  assert_memory_equal(m[0].triangles, m[1].triangles, 3 * (size_t)m[0].triangle_count * sizeof(int32_t));
  assert_memory_equal(m[0].error_bound, m[1].error_bound, 2 * sizeof(double));
  for (int i = 0; i < 2; i++) {
    orb_supermesh_free(ctx[i], &m[i]);
    orb_context_destroy(ctx[i]);
  }
}

static void refusals(void **state) {
  (void)state;
  orb_context *ctx = make_context(1, 0);
  orb_aligned_shape shape;
  orb_supermesh m;
  int32_t *triangles, count;
  sphere_shape(ctx, SPHERE_ICO, 2, 0, 1, &shape);
  assert_int_equal(hull(ctx, &shape, 1, 100, &m), ORB_E_BAD_OPTION); /* 162 vertices need 320 triangles */
  assert_int_equal(orb_qhull(ctx, shape.points, ORB_QHULL_POINTS_MAX + 1, &triangles, &count), ORB_E_TOO_LARGE);
  double flat[12] = {1, 0, 0, 0, 1, 0, -1, 0, 0, 0, -1, 0}; /* in one plane */
  assert_int_equal(orb_qhull(ctx, flat, 4, &triangles, &count), ORB_E_NOT_CERTIFIED);
  orb_context_cancel(ctx);
  assert_int_equal(hull(ctx, &shape, 1, 0, &m), ORB_E_CANCELLED);
  sphere_shape_free(ctx, &shape);
  orb_context_destroy(ctx);
}

static int64_t allocations_left;

static void *failing_alloc(void *user, size_t size) {
  (void)user;
  return allocations_left-- > 0 ? malloc(size) : NULL;
}

static void failing_free(void *user, void *block) {
  (void)user;
  free(block);
}

static void failing_allocations(void **state) {
  (void)state;
  int done = 0;
  for (int64_t n = 0; !done; n++) {
    assert_true(n < 500);
    allocations_left = INT64_MAX;
    orb_context_options options = {.threads = 1, .allocator = {failing_alloc, failing_free, NULL}};
    orb_context *ctx;
    assert_int_equal(orb_context_create(&options, &ctx), ORB_OK);
    orb_aligned_shape shapes[2];
    sphere_shape(ctx, SPHERE_OCTA, 1, 0, 1, &shapes[0]);
    sphere_shape(ctx, SPHERE_UV, 8, 0, 0, &shapes[1]);
    allocations_left = n;
    orb_supermesh m;
    orb_status status = hull(ctx, shapes, 2, 0, &m);
    assert_true(status == ORB_OK || status == ORB_E_NO_MEMORY);
    done = status == ORB_OK;
    orb_supermesh_free(ctx, &m);
    sphere_shape_free(ctx, &shapes[0]);
    sphere_shape_free(ctx, &shapes[1]);
    orb_context_destroy(ctx);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(general_position),    cmocka_unit_test(coincident), cmocka_unit_test(cocircular),
      cmocka_unit_test(nearly_coincident),   cmocka_unit_test(same_bytes), cmocka_unit_test(refusals),
      cmocka_unit_test(failing_allocations),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
