#include "support_align.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "numeric/vec3.h"
#include "support_exact.h"

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

void align_and_check(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                     const orb_landmark *landmarks, int32_t landmark_count, const orb_align_options *options,
                     orb_alignment *out) {
  orb_status status = orb_align(ctx, shapes, shape_count, landmarks, landmark_count, options, out);
  if (status != ORB_OK) {
    print_message("%s\n", orb_context_error(ctx)->detail);
  }
  assert_int_equal(status, ORB_OK);
  check_alignment(out, options->method == ORB_ALIGN_PIN || options->method == ORB_ALIGN_RBF);
}
