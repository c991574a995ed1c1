/* The overlay: compares the exact common refinement with a brute-force evaluation of the shapes. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "numeric/vec3.h"
#include "support_remesh.h"

static orb_status overlay(orb_context *ctx, const orb_aligned_shape *shapes, int count, orb_supermesh *out) {
  orb_remesh_options options;
  orb_remesh_defaults(&options);
  options.method = ORB_REMESH_OVERLAY;
  orb_status status = orb_remesh(ctx, shapes, count, 0, &options, out);
  if (status != ORB_OK && status != ORB_E_NO_MEMORY) {
    print_message("%s: %s\n", orb_status_name(status), orb_context_error(ctx)->detail);
  }
  return status;
}

/* Each shape is linear inside every supermesh triangle, so its position in the direction of a combination of the
 * corners is the combination of their positions, up to the projective weights of the two flat triangles. Compares the
 * distance to the plane with a brute-force evaluation of the shape at three inner directions. */
static void assert_exact(const orb_supermesh *m, const orb_aligned_shape *shapes, int count, int every) {
  static const double weight[3][3] = {{.4, .3, .3}, {.8, .1, .1}, {.1, .2, .7}};
  for (int s = 0; s < count; s++) {
    const orb_mesh *mesh = &shapes[s].mesh;
    double diagonal = sphere_diagonal(&shapes[s]);
    for (int32_t t = 0; t < m->triangle_count; t += every) {
      double corner[3][3], direction[3], p[3], u[3], v[3], n[3], d[3];
      for (int k = 0; k < 3; k++) {
        int32_t c = m->triangles[3 * t + k];
        orb_place_position(mesh, &m->places[(size_t)s * (size_t)m->vertex_count + (size_t)c], corner[k]);
      }
      orb_sub(corner[1], corner[0], u);
      orb_sub(corner[2], corner[0], v);
      orb_cross(u, v, n);
      if (orb_length(n) < 1e-9 * diagonal * diagonal) {
        continue; /* too small for its plane to mean anything in doubles */
      }
      (void)orb_normalize(n);
      for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
          direction[j] = 0;
          for (int k = 0; k < 3; k++) {
            direction[j] += weight[i][k] * m->points[3 * m->triangles[3 * t + k] + j];
          }
        }
        (void)orb_normalize(direction);
        sphere_evaluate(&shapes[s], direction, p);
        orb_sub(p, corner[0], d);
        assert_true(fabs(orb_dot(n, d)) < 1e-6 * diagonal);
      }
    }
  }
}

/* Every input vertex is one supermesh vertex, and every input edge is a chain of supermesh edges: the lengths in space
 * of the supermesh edges on it add up to its length. */
static void assert_edges_present(const orb_supermesh *m, const orb_aligned_shape *shape, int s) {
  const orb_mesh *mesh = &shape->mesh;
  double along = 0, length = 0;
  for (int32_t h = 0; h < 3 * mesh->triangle_count; h++) {
    const double *a = mesh->positions + 3 * mesh->triangles[h], *b = mesh->positions + 3 * mesh->triangles[orb_next(h)];
    length += sqrt(orb_distance2(a, b));
  }
  for (int32_t h = 0; h < 3 * m->triangle_count; h++) {
    const orb_place *p = &m->places[s * m->vertex_count + m->triangles[h]];
    const orb_place *q = &m->places[s * m->vertex_count + m->triangles[orb_next(h)]];
    int32_t support[4];
    int n = 0;
    for (int e = 0; e < 2; e++) {
      const orb_place *place = e ? q : p;
      for (int k = 0; k < 3; k++) {
        int32_t v = mesh->triangles[3 * place->triangle + k];
        if (place->at[k] > 0 && (n < 1 || support[0] != v) && (n < 2 || support[1] != v) && n < 3) {
          support[n++] = v;
        }
      }
    }
    if (n == 2) {
      double a[3], b[3];
      orb_place_position(mesh, p, a);
      orb_place_position(mesh, q, b);
      along += sqrt(orb_distance2(a, b));
    }
  }
  assert_true(fabs(along - length) < 1e-9 * length);
}

static void check(const orb_aligned_shape *shapes, int count, orb_context *ctx, int every, double least, double most) {
  orb_supermesh m;
  assert_int_equal(overlay(ctx, shapes, count, &m), ORB_OK);
  sphere_assert_valid(&m, shapes, count);
  assert_exact(&m, shapes, count, every);
  int64_t inputs = 0;
  for (int s = 0; s < count; s++) {
    assert_edges_present(&m, &shapes[s], s);
    assert_true(m.error_bound[s] < 1e-9 * sphere_diagonal(&shapes[s]));
    inputs += shapes[s].mesh.triangle_count;
  }
  assert_true(m.triangle_count >= least * (double)inputs && m.triangle_count <= most * (double)inputs);
  orb_supermesh_free(ctx, &m);
}

static void check_pair(sphere_kind a, int a_size, unsigned a_seed, sphere_kind b, int b_size, unsigned b_seed,
                       double jitter, double least, double most) {
  orb_context *ctx = remesh_context(2);
  orb_aligned_shape shapes[2];
  sphere_shape(ctx, a, a_size, jitter, a_seed, &shapes[0]);
  sphere_shape(ctx, b, b_size, jitter, b_seed, &shapes[1]);
  check(shapes, 2, ctx, 1 + shapes[0].mesh.triangle_count / 300, least, most);
  sphere_shape_free(ctx, &shapes[0]);
  sphere_shape_free(ctx, &shapes[1]);
  orb_context_destroy(ctx);
}

static void general_position(void **state) {
  (void)state;
  check_pair(SPHERE_ICO, 3, 1, SPHERE_OCTA, 3, 2, 0.2, 3, 7);
  check_pair(SPHERE_UV, 20, 3, SPHERE_ICO, 3, 2, 0.1, 2, 7);
  check_pair(SPHERE_TETRA, 0, 0, SPHERE_ICO, 3, 5, 0, 1, 7);
  check_pair(SPHERE_TETRA, 0, 1, SPHERE_TETRA, 0, 3, 0, 1, 7);
}

/* The overlay of identical meshes is the mesh; that of a mesh and its four-way split is the split: no slivers. */
static void coincidences_add_nothing(void **state) {
  (void)state;
  check_pair(SPHERE_UV, 16, 0, SPHERE_UV, 16, 0, 0, 0.5, 0.5);
  check_pair(SPHERE_ICO, 3, 4, SPHERE_ICO, 3, 4, 0.2, 0.5, 0.5);
  check_pair(SPHERE_TETRA, 0, 0, SPHERE_TETRA, 0, 0, 0, 0.5, 0.5);
  check_pair(SPHERE_OCTA, 0, 0, SPHERE_OCTA, 1, 0, 0, 32. / 40, 32. / 40);
}

/* Poles, meridians and edges in common up to rounding, the worst case: the overlay is still certified, and each shape
 * moves only by rounding. */
static void partial_coincidences(void **state) {
  (void)state;
  static const struct {
    sphere_kind a, b;
    int a_size, b_size;
  } pair[] = {{SPHERE_OCTA, SPHERE_UV, 3, 16}, {SPHERE_OCTA, SPHERE_OCTA, 2, 4}, {SPHERE_UV, SPHERE_UV, 8, 24}};
  for (size_t i = 0; i < sizeof pair / sizeof *pair; i++) {
    orb_context *ctx = remesh_context(1);
    orb_aligned_shape shapes[2];
    sphere_shape(ctx, pair[i].a, pair[i].a_size, 0, 0, &shapes[0]);
    sphere_shape(ctx, pair[i].b, pair[i].b_size, 0, 0, &shapes[1]);
    orb_supermesh m;
    assert_int_equal(overlay(ctx, shapes, 2, &m), ORB_OK);
    sphere_assert_valid(&m, shapes, 2);
    for (int s = 0; s < 2; s++) {
      assert_true(m.error_bound[s] < 1e-6 * sphere_diagonal(&shapes[s]));
    }
    orb_supermesh_free(ctx, &m);
    sphere_shape_free(ctx, &shapes[0]);
    sphere_shape_free(ctx, &shapes[1]);
    orb_context_destroy(ctx);
  }
}

/* The overlay of a shape with itself, moved by rounding or slightly more, has exactly the triangles of the shape. */
static void the_same_but_for_rounding(void **state) {
  (void)state;
  static const double by[] = {1e-16, 1e-14, 1e-12, 1e-10};
  for (size_t i = 0; i < 2 * sizeof by / sizeof *by; i++) {
    orb_context *ctx = remesh_context(1);
    orb_aligned_shape shapes[2];
    uint32_t seed = 7;
    for (int s = 0; s < 2; s++) {
      sphere_shape(ctx, i % 2 ? SPHERE_UV : SPHERE_ICO, i % 2 ? 24 : 4, 0.2, 3, &shapes[s]);
    }
    for (int32_t k = 0; k < 3 * shapes[1].mesh.vertex_count; k++) {
      seed = seed * 1664525u + 1013904223u;
      shapes[1].points[k] += by[i / 2] * ((seed >> 8) / 8388608.0 - 1);
    }
    orb_supermesh m;
    assert_int_equal(overlay(ctx, shapes, 2, &m), ORB_OK);
    sphere_assert_valid(&m, shapes, 2);
    assert_int_equal(m.triangle_count, shapes[0].mesh.triangle_count);
    orb_supermesh_free(ctx, &m);
    sphere_shape_free(ctx, &shapes[0]);
    sphere_shape_free(ctx, &shapes[1]);
    orb_context_destroy(ctx);
  }
}

static void many_shapes(void **state) {
  (void)state;
  orb_context *ctx = remesh_context(2);
  orb_aligned_shape shapes[4];
  sphere_shape(ctx, SPHERE_ICO, 2, 0.2, 1, &shapes[0]);
  sphere_shape(ctx, SPHERE_OCTA, 2, 0.2, 2, &shapes[1]);
  sphere_shape(ctx, SPHERE_UV, 10, 0, 3, &shapes[2]);
  sphere_shape(ctx, SPHERE_TETRA, 0, 0, 0, &shapes[3]);
  check(shapes, 3, ctx, 7, 3, 14);
  check(shapes, 4, ctx, 7, 3, 14);
  for (int s = 0; s < 4; s++) {
    sphere_shape_free(ctx, &shapes[s]);
  }
  orb_context_destroy(ctx);
}

static void threads_do_not_matter(void **state) {
  (void)state;
  remesh_assert_threads_do_not_matter(ORB_REMESH_OVERLAY);
}

static void failing_allocations(void **state) {
  (void)state;
  remesh_assert_fails_cleanly(ORB_REMESH_OVERLAY);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(general_position),     cmocka_unit_test(coincidences_add_nothing),
      cmocka_unit_test(partial_coincidences), cmocka_unit_test(the_same_but_for_rounding),
      cmocka_unit_test(many_shapes),          cmocka_unit_test(threads_do_not_matter),
      cmocka_unit_test(failing_allocations),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
