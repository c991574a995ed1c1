/* pin and rbf on generated bodies: landmarks meet bit for bit and nothing folds, whether the landmarks are near, on
 * edges, inside triangles, next to each other or randomly permuted; any number of threads gives the same bytes; cancel
 * and lack of memory are clean errors. */
#include <limits.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "align/rbf/warp.h"
#include "base/memory.h"
#include "numeric/vec3.h"
#include "orbmorph/align.h"
#include "support_align.h"
#include "support_bodies.h"
#include "support_shapes.h"

static void like_landmarks_meet(void **state) {
  (void)state;
  bodies b;
  bodies_open(&b, NULL);
  for (int count = 1; count <= 20; count += count < 4 ? 1 : 8) {
    bodies_like(&b, count);
    for (int m = 0; m < 2; m++) {
      orb_align_options options = bodies_options(m ? ORB_ALIGN_RBF : ORB_ALIGN_PIN);
      orb_alignment out;
      align_and_check(b.ctx, b.shape, 3, b.landmark, count, &options, &out);
      for (int s = 0; s < 3; s++) {
        assert_int_equal(out.shapes[s].landmark_vertices[0], bodies_vertex_at(&b.mesh[s], &b.at[0][s]));
      }
      orb_alignment_free(b.ctx, &out);
    }
  }
  bodies_close(&b);
}

static void random_landmarks_meet(void **state) {
  (void)state;
  bodies b;
  bodies_open(&b, NULL);
  orb_align_options options = bodies_options(ORB_ALIGN_PIN);
  for (uint64_t seed = 0; seed < 6; seed++) {
    int count = seed < 3 ? 3 : 9;
    bodies_random(&b, count, seed);
    orb_alignment out;
    align_and_check(b.ctx, b.shape, 2, b.landmark, count, &options, &out);
    orb_alignment_free(b.ctx, &out);
  }
  bodies_close(&b);
}

/* After splits and thinning, a corner's attributes are those of the given triangle at that point. Here texture
 * coordinates and colours are linear in space. */
static void attributes_stay_linear(void **state) {
  (void)state;
  bodies b;
  bodies_open(&b, NULL);
  bodies_random(&b, 30, 5);
  for (int s = 0; s < 2; s++) {
    orb_mesh *mesh = &b.mesh[s];
    size_t corners = 3 * (size_t)mesh->triangle_count;
    mesh->texcoords = ORB_NEW(b.ctx, float, 2 * corners);
    mesh->colors = ORB_NEW(b.ctx, float, 4 * corners);
    assert_true(mesh->texcoords && mesh->colors);
    for (size_t h = 0; h < corners; h++) {
      const double *x = mesh->positions + 3 * (size_t)mesh->triangles[h];
      for (int k = 0; k < 3; k++) {
        mesh->colors[4 * h + (size_t)k] = (float)x[k];
      }
      mesh->colors[4 * h + 3] = 1;
      mesh->texcoords[2 * h] = (float)(x[0] - x[1]);
      mesh->texcoords[2 * h + 1] = (float)(x[2] + 0.5 * x[1]);
    }
  }
  orb_align_options options = bodies_options(ORB_ALIGN_PIN);
  orb_alignment out;
  align_and_check(b.ctx, b.shape, 2, b.landmark, 30, &options, &out);
  int32_t grown = 0;
  for (int s = 0; s < 2; s++) {
    const orb_mesh *mesh = &out.shapes[s].mesh;
    grown += mesh->triangle_count - b.mesh[s].triangle_count;
    assert_true(mesh->triangle_count < 8 * b.mesh[s].triangle_count);
    for (int32_t h = 0; h < 3 * mesh->triangle_count; h++) {
      const double *x = mesh->positions + 3 * (size_t)mesh->triangles[h];
      for (int k = 0; k < 3; k++) {
        assert_true(fabs((double)mesh->colors[4 * h + k] - x[k]) < 1e-5);
      }
      assert_true(fabs((double)mesh->texcoords[2 * h] - (x[0] - x[1])) < 1e-5);
      assert_true(fabs((double)mesh->texcoords[2 * h + 1] - (x[2] + 0.5 * x[1])) < 1e-5);
    }
  }
  assert_true(grown > 0);
  orb_alignment_free(b.ctx, &out);
  for (int s = 0; s < 2; s++) {
    orb_free(b.ctx, b.mesh[s].texcoords);
    orb_free(b.ctx, b.mesh[s].colors);
  }
  bodies_close(&b);
}

/* Neighbours on one shape, distant on the other; places inside a triangle and on edges. */
static void awkward_places_meet(void **state) {
  (void)state;
  bodies b;
  bodies_open(&b, NULL);
  bodies_like(&b, 7);
  int32_t t = 200;
  b.at[0][0] = (orb_place){t, {1, 0, 0}};
  b.at[1][0] = (orb_place){t, {0, 1, 0}};
  b.at[2][0] = (orb_place){t, {0, 0, 1}};
  b.at[3][0] = (orb_place){t, {0.2, 0.2, 0.6}};
  b.at[4][0] = (orb_place){t, {0.5, 0.5, 0}};
  b.at[5][0] = (orb_place){t, {0.6, 0.2, 0.2}};
  b.at[6][1].at[0] = b.at[6][1].at[1] = b.at[6][1].at[2] = 1.0 / 3;
  orb_align_options options = bodies_options(ORB_ALIGN_PIN);
  orb_alignment out;
  align_and_check(b.ctx, b.shape, 2, b.landmark, 7, &options, &out);
  orb_alignment_free(b.ctx, &out);
  bodies_close(&b);
}

/* Four landmarks on two tetrahedra, in all 24 orders: half of them turn the surface inside out unless it is refined. */
static void tetrahedra_in_all_orders(void **state) {
  (void)state;
  orb_context *ctx;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  orb_mesh mesh = shape_tetrahedron(ctx);
  double points[12], centre[3] = {0, 0, 0};
  for (int i = 0; i < 12; i++) {
    centre[i % 3] += mesh.positions[i] / 4;
  }
  for (int v = 0; v < 4; v++) {
    orb_sub(mesh.positions + 3 * v, centre, points + 3 * v);
    orb_normalize(points + 3 * v);
  }
  orb_align_shape shapes[2] = {{&mesh, points}, {&mesh, points}};
  for (int order = 0; order < 24; order++) {
    int left[4] = {0, 1, 2, 3}, rest = order;
    orb_place at[4][2];
    orb_landmark landmarks[4];
    memset(landmarks, 0, sizeof landmarks);
    for (int k = 0; k < 4; k++) {
      int pick = rest % (4 - k);
      rest /= 4 - k;
      assert_int_equal(orb_place_of_vertex(ctx, &mesh, k, &at[k][0]), ORB_OK);
      assert_int_equal(orb_place_of_vertex(ctx, &mesh, left[pick], &at[k][1]), ORB_OK);
      memmove(left + pick, left + pick + 1, (size_t)(3 - pick) * sizeof *left);
      landmarks[k].at = at[k];
    }
    orb_align_options options = bodies_options(ORB_ALIGN_PIN);
    orb_alignment out;
    align_and_check(ctx, shapes, 2, landmarks, 4, &options, &out);
    orb_alignment_free(ctx, &out);
  }
  shape_free(ctx, &mesh);
  orb_context_destroy(ctx);
}

static void twins_merge(void **state) {
  (void)state;
  bodies b;
  bodies_open(&b, NULL);
  bodies_like(&b, 6);
  memcpy(b.at[5], b.at[2], sizeof b.at[5]);
  orb_align_options options = bodies_options(ORB_ALIGN_PIN);
  orb_alignment out;
  align_and_check(b.ctx, b.shape, 2, b.landmark, 6, &options, &out);
  assert_int_equal(out.shapes[1].landmark_vertices[5], out.shapes[1].landmark_vertices[2]);
  orb_alignment_free(b.ctx, &out);
  bodies_close(&b);
}

static void same_bytes_for_any_threads(void **state) {
  (void)state;
  for (int m = 0; m < 3; m++) {
    double *first = NULL;
    size_t size = 0;
    for (int threads = 1; threads <= 3; threads++) {
      bodies b;
      orb_context_options context = {.threads = threads};
      bodies_open(&b, &context);
      if (m == 2) {
        bodies_random(&b, 9, 4);
      } else {
        bodies_like(&b, 12);
      }
      orb_align_options options = bodies_options(m == 1 ? ORB_ALIGN_RBF : ORB_ALIGN_PIN);
      orb_alignment out;
      align_and_check(b.ctx, b.shape, 2, b.landmark, m == 2 ? 9 : 12, &options, &out);
      size_t bytes = 3 * (size_t)out.shapes[1].mesh.vertex_count * sizeof(double);
      if (!first) {
        size = bytes;
        first = malloc(bytes);
        assert_non_null(first);
        memcpy(first, out.shapes[1].points, bytes);
      }
      assert_int_equal(bytes, size);
      assert_memory_equal(first, out.shapes[1].points, bytes);
      orb_alignment_free(b.ctx, &out);
      bodies_close(&b);
    }
    free(first);
  }
}

static void cancel_ends_it(void **state) {
  (void)state;
  for (int m = 0; m < 3; m++) {
    bodies b;
    bodies_open(&b, NULL);
    bodies_like(&b, 8);
    orb_context_cancel(b.ctx);
    orb_align_options options = bodies_options((orb_align_method)m);
    orb_alignment out;
    assert_int_equal(orb_align(b.ctx, b.shape, 2, b.landmark, 8, &options, &out), ORB_E_CANCELLED);
    assert_null(out.shapes);
    bodies_close(&b);
  }
}

/* Fails the n-th allocation. */
typedef struct failing {
  long left;
} failing;

static void *failing_alloc(void *user, size_t size) {
  failing *f = user;
  return f->left-- == 0 ? NULL : malloc(size);
}

static void failing_free(void *user, void *block) {
  (void)user;
  free(block);
}

static void lack_of_memory_is_an_error(void **state) {
  (void)state;
  for (int m = 0; m < 3; m++) {
    int refused = 0, succeeded = 0;
    for (long n = 0; !succeeded && n < 2000; n += n < 60 ? 1 : 23) {
      failing f = {.left = LONG_MAX};
      bodies b;
      orb_context_options context = {.threads = 1, .allocator = {failing_alloc, failing_free, &f}};
      bodies_open(&b, &context);
      if (m == 2) {
        bodies_random(&b, 9, 4);
      } else {
        bodies_like(&b, 6);
      }
      orb_align_options options = bodies_options(m == 1 ? ORB_ALIGN_RBF : ORB_ALIGN_PIN);
      orb_alignment out;
      f.left = n;
      orb_status status = orb_align(b.ctx, b.shape, 2, b.landmark, m == 2 ? 9 : 6, &options, &out);
      int spent = f.left < 0;
      f.left = LONG_MAX;
      if (status == ORB_OK) {
        succeeded = !spent;
        orb_alignment_free(b.ctx, &out);
      } else {
        assert_int_equal(status, ORB_E_NO_MEMORY);
        refused++;
      }
      bodies_close(&b);
    }
    assert_true(refused > 30);
  }
}

/* The warp moves each centre to its target, applies only the linear part beyond every radius, and uses the function
 * that the paper states. */
static void warp_interpolates(void **state) {
  (void)state;
  orb_context *ctx;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  assert_true(orb_warp_phi(0) == 1 && fabs(orb_warp_phi(1)) < 1e-14 && orb_warp_phi(1.5) == 0);
  assert_true(fabs(orb_warp_phi(0.5) - (1 - 7.5 - 1.25 + 2.8125 - 0.1875 + 7.5 * 0.69314718055994531)) < 1e-13);
  double centres[15] = {1, 0, 0, 0, 1, 0, 0, 0, 1, -0.6, 0.8, 0, 0, -0.6, 0.8}, moves[15],
         radii[5] = {1, 1, 0.7, 1, 1.2}, out[15], goal[15];
  for (int i = 0; i < 15; i++) {
    goal[i] = centres[i] + 0.1 * sin(i * 1.7);
  }
  for (int k = 0; k < 5; k++) {
    orb_normalize(goal + 3 * k);
    orb_sub(goal + 3 * k, centres + 3 * k, moves + 3 * k);
  }
  for (int count = 1; count <= 5; count++) {
    orb_warp warp;
    assert_int_equal(orb_warp_create(ctx, centres, moves, radii, count, &warp), ORB_OK);
    orb_warp_apply(ctx, &warp, centres, count, out);
    double sum[3] = {0, 0, 0};
    for (int k = 0; k < count; k++) {
      assert_true(orb_distance2(out + 3 * k, goal + 3 * k) < 1e-24);
      for (int c = 0; c < 3; c++) {
        sum[c] += warp.coefficients[3 * k + c];
      }
    }
    assert_true(count < 5 || orb_length(sum) < 1e-10);
    orb_warp_free(ctx, &warp);
  }
  orb_context_destroy(ctx);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(like_landmarks_meet),        cmocka_unit_test(random_landmarks_meet),
      cmocka_unit_test(attributes_stay_linear),     cmocka_unit_test(awkward_places_meet),
      cmocka_unit_test(tetrahedra_in_all_orders),   cmocka_unit_test(twins_merge),
      cmocka_unit_test(same_bytes_for_any_threads), cmocka_unit_test(cancel_ends_it),
      cmocka_unit_test(lack_of_memory_is_an_error), cmocka_unit_test(warp_interpolates),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
