/* Positions at places, smooth normals, colours at seams, and the distances of a reconstructed shape. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"
#include "support_shapes.h"
#include "support_supermesh.h"
#include "transfer/rotation.h"
#include "transfer/wedge.h"

static int setup(void **state) {
  return orb_context_create(NULL, (orb_context **)state) == ORB_OK ? 0 : -1;
}
static int teardown(void **state) {
  orb_context_destroy(*state);
  return 0;
}

static void same(int32_t shape, const double p[3], double out[3]) {
  (void)shape;
  memcpy(out, p, 3 * sizeof *out);
}

static void places_give_positions(void **state) {
  orb_context *ctx = *state;
  synthetic made = synthetic_make(ctx, 2, 2, same);
  const orb_mesh *mesh = &made.shapes[0].mesh;
  orb_place places[2] = {{.triangle = 5, .at = {0, 1, 0}}, {.triangle = 7, .at = {0.5, 0.25, 0.25}}};
  double out[6];
  assert_int_equal(orb_transfer_positions(ctx, &made.shapes[0], places, 2, out), ORB_OK);
  for (int c = 0; c < 3; c++) {
    assert_true(out[c] == mesh->positions[3 * mesh->triangles[16] + c]); /* bit for bit */
    double wanted =
        0.5 * mesh->positions[3 * mesh->triangles[21] + c] +
        0.25 * (mesh->positions[3 * mesh->triangles[22] + c] + mesh->positions[3 * mesh->triangles[23] + c]);
    assert_true(fabs(out[3 + c] - wanted) < 1e-15);
  }
  synthetic_free(ctx, &made);
}

/* Angle weights make the normal at an octahedron's tip its axis, and a cube's corner normal the diagonal however the
 * faces are cut. */
static void smooth_normals_are_symmetric(void **state) {
  orb_context *ctx = *state;
  orb_mesh ball = shape_ball(ctx, 0);
  double normals[18];
  assert_int_equal(
      orb_smooth_normals(ctx, ball.positions, ball.vertex_count, ball.triangles, ball.triangle_count, normals), ORB_OK);
  for (int i = 0; i < 18; i++) {
    assert_true(fabs(normals[i] - ball.positions[i]) < 1e-15);
  }
  shape_free(ctx, &ball);
  static const double cube[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1};
  static const int32_t faces[] = {0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4,
                                  1, 2, 6, 1, 6, 5, 2, 3, 7, 2, 7, 6, 3, 0, 4, 3, 4, 7};
  double corner[24];
  assert_int_equal(orb_smooth_normals(ctx, cube, 8, faces, 12, corner), ORB_OK);
  for (int i = 0; i < 24; i++) {
    assert_true(fabs(corner[i] - (cube[i] - 0.5) * 2 / sqrt(3)) < 1e-15);
  }
}

/* The octants of an octahedron in eight colours, on a ball split once more than its input: each corner has the colour
 * of its own octant, though vertices lie on the input's edges and at its vertices. */
static void colours_keep_to_their_side(void **state) {
  orb_context *ctx = *state;
  synthetic fine = synthetic_make(ctx, 1, 1, same), coarse = synthetic_make(ctx, 0, 1, same);
  orb_mesh *input = &coarse.shapes[0].mesh;
  input->colors = ORB_NEW(ctx, float, 4 * 3 * 8);
  for (int h = 0; h < 24; h++) {
    for (int c = 0; c < 4; c++) {
      float sum = 0;
      for (int k = 0; c < 3 && k < 3; k++) {
        sum += (float)input->positions[3 * input->triangles[3 * (h / 3) + k] + c];
      }
      input->colors[4 * h + c] = sum > 0 || c == 3 ? 1 : 0;
    }
  }
  /* Places of the fine ball's vertices on the coarse octahedron: at vertices and at the middle of edges. */
  for (int v = 0; v < fine.supermesh.vertex_count; v++) {
    const double *p = fine.supermesh.points + 3 * v;
    for (int t = 0; t < 8; t++) {
      double at[3], sum = 0;
      int inside = 1;
      for (int k = 0; k < 3; k++) {
        const double *q = input->positions + 3 * input->triangles[3 * t + k];
        at[k] = p[0] * q[0] + p[1] * q[1] + p[2] * q[2]; /* corners are ± axes */
        inside &= at[k] >= 0;
        sum += at[k];
      }
      if (inside) {
        fine.supermesh.places[v] = (orb_place){.triangle = t, .at = {at[0] / sum, at[1] / sum, at[2] / sum}};
      }
    }
  }
  orb_wedges colors;
  assert_int_equal(orb_wedge_colors(ctx, &fine.supermesh, &coarse.shapes[0], 0, &colors), ORB_OK);
  for (int t = 0; t < fine.supermesh.triangle_count; t++) {
    for (int c = 0; c < 3; c++) {
      double middle = 0;
      for (int k = 0; k < 3; k++) {
        middle += fine.supermesh.points[3 * fine.supermesh.triangles[3 * t + k] + c];
      }
      for (int k = 0; k < 3; k++) {
        const float *value = colors.values + 4 * orb_wedge_of(&colors, fine.supermesh.triangles, 3 * t + k);
        assert_true(value[c] == (middle > 0 ? 1.0f : 0.0f));
      }
    }
  }
  /* Each of the 6 corners has 4 colours and each of the 12 middles has 2. */
  assert_int_equal(colors.value_count, 6 * 4 + 12 * 2);
  orb_wedges_free(ctx, &colors);
  synthetic_free(ctx, &fine);
  synthetic_free(ctx, &coarse);
}

static void rotations_are_found(void **state) {
  (void)state;
  static const double quaternions[][4] = {{1, 0, 0, 0}, {0.5, 0.5, 0.5, 0.5}, {0.1, 0.7, -0.1, 0.7}, {0, 0.6, 0, 0.8}};
  for (int i = 0; i < 4; i++) {
    double r[3][3], h[3][3] = {{0}}, q[4], found[3][3];
    orb_rotation_matrix(quaternions[i], r);
    static const double a[3][3] = {{1, 0.2, 0}, {-0.3, 2, 0.1}, {0.4, 0, -0.7}};
    for (int k = 0; k < 3; k++) {
      for (int x = 0; x < 3; x++) {
        for (int y = 0; y < 3; y++) {
          h[x][y] += a[k][x] * (r[y][0] * a[k][0] + r[y][1] * a[k][1] + r[y][2] * a[k][2]);
        }
      }
    }
    orb_rotation_fit(h, q);
    orb_rotation_matrix(q, found);
    for (int x = 0; x < 9; x++) {
      assert_true(fabs(found[x / 3][x % 3] - r[x / 3][x % 3]) < 1e-12);
    }
  }
}

static void a_shape_on_itself_has_no_error(void **state) {
  orb_context *ctx = *state;
  synthetic made = synthetic_make(ctx, 4, 1, same);
  orb_shape_report report;
  assert_int_equal(orb_shape_measure(ctx, &made.shapes[0], &made.supermesh, 0, &report), ORB_OK);
  assert_true(report.hausdorff_sampled < 1e-15 && report.rms < 1e-15);
  assert_true(report.normal_mean < 0.01 && report.normal_p99 < 0.02);
  assert_true(fabs(report.diagonal - 2 * sqrt(3)) < 1e-15);
  assert_true(report.min_area_ratio > 0.2 && report.min_area_ratio < 1);
  synthetic_free(ctx, &made);
}

/* An octahedron that represents a fine ball: the ball's farthest points lie over the middles of the faces, 1 − 1/√3
 * away; the rms lies within the range that the faces' distances allow; normals differ most at the corners, by
 * acos(1/√3). */
static void an_octahedron_for_a_ball(void **state) {
  orb_context *ctx = *state;
  synthetic fine = synthetic_make(ctx, 5, 1, same), coarse = synthetic_make(ctx, 0, 1, same);
  for (int v = 0; v < coarse.supermesh.vertex_count; v++) { /* its vertices are the ball's first ones: find them */
    for (int w = 0; w < fine.supermesh.vertex_count; w++) {
      if (memcmp(fine.supermesh.points + 3 * w, coarse.supermesh.points + 3 * v, 3 * sizeof(double)) == 0) {
        coarse.supermesh.places[v] = fine.supermesh.places[w];
      }
    }
  }
  orb_shape_report report;
  assert_int_equal(orb_shape_measure(ctx, &fine.shapes[0], &coarse.supermesh, 0, &report), ORB_OK);
  double farthest = 1 - 1 / sqrt(3);
  assert_true(report.hausdorff_sampled < farthest + 1e-12 && report.hausdorff_sampled > farthest - 2e-3);
  assert_true(report.rms > 0.25 * farthest && report.rms < farthest);
  assert_true(report.normal_p99 > 30 && report.normal_p99 < acos(1 / sqrt(3)) * 180 / M_PI + 2);
  assert_true(report.normal_mean > 10 && report.normal_mean < report.normal_p99);
  synthetic_free(ctx, &fine);
  synthetic_free(ctx, &coarse);
}

static void bumpy(int32_t shape, const double p[3], double out[3]) {
  (void)shape;
  double r = 1 + 0.2 * sin(5 * p[0]) * cos(4 * p[1]) + 0.01 * sin(60 * p[2]);
  for (int c = 0; c < 3; c++) {
    out[c] = r * p[c];
  }
}

/* If a bound is proved, fewer samples are taken: the figures stay within a few per cent of those of all samples, and
 * the sampled distance is at most that of all. */
static void a_bound_needs_fewer_samples(void **state) {
  orb_context *ctx = *state;
  synthetic fine = synthetic_make(ctx, 6, 1, bumpy), coarse = synthetic_make(ctx, 4, 1, bumpy);
  orb_shape_report all, some;
  for (int v = 0; v < coarse.supermesh.vertex_count; v++) { /* finer balls keep the vertices of coarse ones, in order */
    coarse.supermesh.places[v] = fine.supermesh.places[v];
  }
  coarse.supermesh.error_bound[0] = NAN;
  assert_int_equal(orb_shape_measure(ctx, &fine.shapes[0], &coarse.supermesh, 0, &all), ORB_OK);
  coarse.supermesh.error_bound[0] = 1.001 * all.hausdorff_sampled;
  assert_int_equal(orb_shape_measure(ctx, &fine.shapes[0], &coarse.supermesh, 0, &some), ORB_OK);
  assert_true(all.hausdorff_sampled > 0.01 && isnan(all.hausdorff));
  assert_true(some.hausdorff_sampled <= all.hausdorff_sampled && some.hausdorff_sampled > 0.9 * all.hausdorff_sampled);
  assert_true(some.rms != all.rms && fabs(some.rms / all.rms - 1) < 0.04);
  assert_true(fabs(some.normal_mean / all.normal_mean - 1) < 0.04);
  assert_true(fabs(some.normal_p99 / all.normal_p99 - 1) < 0.04);
  assert_true(some.min_area_ratio == all.min_area_ratio);
  synthetic_free(ctx, &fine);
  synthetic_free(ctx, &coarse);
}

static void threads_change_no_bit(void **state) {
  (void)state;
  orb_shape_report report[2];
  memset(report, 0, sizeof report);
  for (int i = 0; i < 2; i++) {
    orb_context *ctx;
    orb_context_options options = {.threads = i ? 3 : 1};
    assert_int_equal(orb_context_create(&options, &ctx), ORB_OK);
    synthetic fine = synthetic_make(ctx, 5, 1, bumpy), coarse = synthetic_make(ctx, 3, 1, bumpy);
    for (int v = 0; v < coarse.supermesh.vertex_count; v++) {
      coarse.supermesh.places[v] = fine.supermesh.places[v];
    }
    assert_int_equal(orb_shape_measure(ctx, &fine.shapes[0], &coarse.supermesh, 0, &report[i]), ORB_OK);
    synthetic_free(ctx, &fine);
    synthetic_free(ctx, &coarse);
    orb_context_destroy(ctx);
  }
  assert_true(report[0].rms > 0);
  assert_memory_equal(&report[0], &report[1], sizeof *report);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(places_give_positions, setup, teardown),
      cmocka_unit_test_setup_teardown(smooth_normals_are_symmetric, setup, teardown),
      cmocka_unit_test_setup_teardown(colours_keep_to_their_side, setup, teardown),
      cmocka_unit_test(rotations_are_found),
      cmocka_unit_test_setup_teardown(a_shape_on_itself_has_no_error, setup, teardown),
      cmocka_unit_test_setup_teardown(an_octahedron_for_a_ball, setup, teardown),
      cmocka_unit_test_setup_teardown(a_bound_needs_fewer_samples, setup, teardown),
      cmocka_unit_test(threads_change_no_bit),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
