#include "support_align.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "numeric/vec3.h"
#include "support_exact.h"

const int thread_counts[3] = {5, 1, 2};

void check_alignment(const orb_alignment *alignment, int landmarks_meet) {
  for (int32_t s = 0; s < alignment->shape_count; s++) {
    const orb_aligned_shape *shape = &alignment->shapes[s];
    const orb_mesh *mesh = &shape->mesh;
    assert_int_equal(mesh->triangle_count, 2 * mesh->vertex_count - 4);
    assert_true(shape->certificate.valid && shape->certificate.exact);
    double angles = 0;
    int32_t step = mesh->triangle_count / 500 + 1;
    for (int32_t t = 0; t < mesh->triangle_count; t++) {
      const double *p[3];
      for (int k = 0; k < 3; k++) {
        p[k] = shape->points + 3 * (size_t)mesh->triangles[3 * t + k];
      }
      angles +=
          2 * atan2(orb_det(p[0], p[1], p[2]), 1 + orb_dot(p[0], p[1]) + orb_dot(p[1], p[2]) + orb_dot(p[2], p[0]));
      if (t % step == 0) {
        assert_int_equal(exact_orientation(p[0], p[1], p[2]), 1);
      }
    }
    assert_true(fabs(angles / (4 * M_PI) - 1) < 1e-6);
    for (int32_t v = 0; v < mesh->vertex_count; v++) {
      assert_true(fabs(orb_length(shape->points + 3 * (size_t)v) - 1) < 1e-12);
    }
    for (int32_t k = 0; landmarks_meet && k < alignment->landmark_count; k++) {
      const orb_aligned_shape *first = &alignment->shapes[0];
      assert_memory_equal(first->points + 3 * (size_t)first->landmark_vertices[k],
                          shape->points + 3 * (size_t)shape->landmark_vertices[k], 3 * sizeof(double));
    }
  }
}

static void area_vector(const orb_mesh *mesh, int32_t t, double out[3]) {
  const double *p[3];
  double u[3], w[3];
  for (int k = 0; k < 3; k++) {
    p[k] = mesh->positions + 3 * (size_t)mesh->triangles[3 * t + k];
  }
  orb_sub(p[1], p[0], u);
  orb_sub(p[2], p[0], w);
  orb_cross(u, w, out);
}

/* The pieces of a given triangle face the same way and their areas add up to its area, so they tile it. Given vertices
 * keep their positions; landmarks are at the requested places. */
static void check_surface(const orb_aligned_shape *shape, const orb_mesh *given, const orb_landmark *landmarks,
                          int32_t landmark_count, int32_t s) {
  orb_extent extent;
  orb_mesh_extent(given, &extent);
  double little = 1e-9 * extent.diagonal * extent.diagonal, *covered = calloc((size_t)given->triangle_count, 8);
  assert_non_null(covered);
  for (int32_t t = 0; t < shape->mesh.triangle_count; t++) {
    double n[3], m[3];
    int32_t parent = shape->parent[t];
    assert_true(parent >= 0 && parent < given->triangle_count);
    area_vector(&shape->mesh, t, n);
    area_vector(given, parent, m);
    assert_true(orb_dot(n, m) >= -little * orb_length(m));
    covered[parent] += orb_length(n);
  }
  for (int32_t t = 0; t < given->triangle_count; t++) {
    double m[3];
    area_vector(given, t, m);
    assert_true(fabs(covered[t] - orb_length(m)) <= little);
  }
  free(covered);
  assert_memory_equal(shape->mesh.positions, given->positions, 3 * (size_t)given->vertex_count * sizeof(double));
  for (int32_t k = 0; k < landmark_count; k++) {
    double x[3];
    orb_place_position(given, &landmarks[k].at[s], x);
    assert_true(orb_distance2(x, shape->mesh.positions + 3 * (size_t)shape->landmark_vertices[k]) <= little * 1e-3);
  }
}

void align_and_check(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                     const orb_landmark *landmarks, int32_t landmark_count, const orb_align_options *options,
                     orb_alignment *out) {
  orb_status status = orb_align(ctx, shapes, shape_count, landmarks, landmark_count, options, out);
  if (status != ORB_OK) {
    print_message("%s\n", orb_context_error(ctx)->detail);
  }
  assert_int_equal(status, ORB_OK);
  check_alignment(out, options->method == ORB_ALIGN_PIN || options->method == ORB_ALIGN_RBF);
  for (int32_t s = 0; s < shape_count; s++) {
    check_surface(&out->shapes[s], shapes[s].mesh, landmarks, landmark_count, s);
  }
}
