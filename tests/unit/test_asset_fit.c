/* The fit of an asset: which shapes are moved onto the first one, how, and what the reports say. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "support_asset.h"

static void moved_copy(int32_t shape, const double p[3], double out[3]) {
  double q[3];
  memcpy(q, p, sizeof q);
  q[0] *= 2.5; /* an ellipsoid */
  q[1] *= 1.5; /* no symmetry that a rotation could hide in */
  q[0] += 0.3 * p[1] * p[1] + 0.2 * p[2];
  double turn = 2.1 * shape, scale = 1 + 2 * shape;
  out[0] = scale * (cos(turn) * q[0] - sin(turn) * q[1]) + 5 * shape;
  out[1] = scale * (sin(turn) * q[0] + cos(turn) * q[1]) - 7 * shape;
  out[2] = scale * q[2] + shape;
}

/* A shape and its copy, rotated, scaled and shifted: a similarity undoes that, so all deltas vanish. */
static void fit_undoes_a_similarity(void **state) {
  orb_context *ctx = *state;
  synthetic made = synthetic_make(ctx, 3, 2, moved_copy);
  orb_asset_options options;
  orb_asset_defaults(&options);
  options.fit = ORB_FIT_SIMILARITY;
  orb_buffer bytes;
  glb file = asset_write(ctx, &made, &options, NULL, &bytes);
  const cJSON *target = cJSON_GetArrayItem(cJSON_GetObjectItem(asset_primitive(&file, 0), "targets"), 0);
  int position = glb_attribute(target, "POSITION"), normal = glb_attribute(target, "NORMAL");
  for (int v = 0; v < glb_count(&file, position); v++) {
    for (int c = 0; c < 3; c++) {
      assert_true(fabs(glb_value(&file, position, v, c)) < 1e-6);
      assert_true(fabs(glb_value(&file, normal, v, c)) < 1e-6);
    }
  }
  glb_close(&file);
  orb_buffer_free(ctx, &bytes);
  synthetic_free(ctx, &made);
}

/* A ball that is scaled, rotated about y or z and shifted. */
static double copy_scale, copy_turn, copy_shift;
static int copy_axis;
static void placed_copy(int32_t shape, const double p[3], double out[3]) {
  double scale = shape ? copy_scale : 1, turn = shape ? copy_turn * M_PI / 180 : 0;
  int a = (copy_axis + 1) % 3, b = (copy_axis + 2) % 3;
  double q[3] = {2 * p[0], 1.5 * p[1], p[2]};
  out[a] = scale * (cos(turn) * q[a] - sin(turn) * q[b]);
  out[b] = scale * (sin(turn) * q[a] + cos(turn) * q[b]);
  out[copy_axis] = scale * q[copy_axis];
  out[0] += shape ? copy_shift * 2 * sqrt(4 + 2.25 + 1) : 0; /* diagonals of the first shape */
}

/* auto moves a shape only beyond 1.5 times, 30° or half a diagonal, and reports what it did. */
static void auto_fits_what_clearly_differs(void **state) {
  orb_context *ctx = *state;
  static const struct {
    double scale, turn, shift;
    int axis, moved;
    double up;
  } cases[] = {{1, 0, 0, 2, 0, 0},       {1.45, 25, 0.1, 2, 0, 0}, {1.6, 0, 0, 2, 1, 0},  {1 / 1.45, 0, 0, 2, 0, 0},
               {1 / 1.6, 0, 0, 2, 1, 0}, {1, 29, 0, 2, 0, 0},      {1, 31, 0, 2, 1, 31},  {1, 90, 0, 0, 1, 90},
               {1, 90, 0, 1, 1, 0},      {1, 0, 0.45, 2, 0, 0},    {1, 0, 0.55, 2, 1, 0}, {100, 180, 3, 0, 1, 180}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    copy_scale = cases[i].scale;
    copy_turn = cases[i].turn;
    copy_shift = cases[i].shift;
    copy_axis = cases[i].axis;
    synthetic made = synthetic_make(ctx, 3, 2, placed_copy);
    orb_fit_report reports[2];
    double m[32];
    assert_int_equal(orb_asset_transforms(ctx, &made.supermesh, made.shapes, ORB_FIT_AUTO, m, reports), ORB_OK);
    assert_int_equal(reports[0].kind, ORB_FIT_NONE);
    assert_int_equal(reports[1].kind, cases[i].moved ? ORB_FIT_SIMILARITY : ORB_FIT_NONE);
    assert_true(fabs(reports[1].scale - (cases[i].moved ? 1 / copy_scale : 1)) < 1e-9);
    assert_true(fabs(reports[1].rotation_degrees - (cases[i].moved ? copy_turn : 0)) < 1e-5);
    assert_true(fabs(reports[1].translation_relative - (cases[i].moved ? copy_shift : 0)) < 1e-6 * fmax(1, copy_scale));
    assert_true(fabs(reports[1].up_degrees - cases[i].up) < 1e-5);
    synthetic_free(ctx, &made);
  }
}

/* A body, and a body of other proportions that leans forward, is ten times as large and has z up. */
static void leaning_copy(int32_t shape, const double p[3], double out[3]) {
  double q[3] = {p[0], 1.2 * p[1], 0.5 * p[2]};
  if (shape == 0) {
    memcpy(out, q, sizeof q);
    return;
  }
  q[2] *= 2;
  q[0] = 0.6 * q[0] + 0.5 * q[1];
  out[0] = 10 * q[0];
  out[1] = -10 * q[2];
  out[2] = 10 * q[1];
}

/* The best rotation would tip the leaning body over backwards. auto keeps its posture and rotates it by the right angle
 * between the files' axes; if the request asks for a similarity, it gets the best one. */
static void auto_leaves_a_posture(void **state) {
  orb_context *ctx = *state;
  synthetic made = synthetic_make(ctx, 3, 2, leaning_copy);
  orb_fit_report reports[2];
  double m[32];
  assert_int_equal(orb_asset_transforms(ctx, &made.supermesh, made.shapes, ORB_FIT_AUTO, m, reports), ORB_OK);
  assert_int_equal(reports[1].kind, ORB_FIT_SIMILARITY);
  assert_true(fabs(reports[1].rotation_degrees - 90) < 1e-6);
  for (int k = 0; k < 3; k++) { /* z of its file becomes y */
    assert_true(fabs(m[16 + 4 * 2 + k] / reports[1].scale - (k == 1)) < 1e-9);
  }
  assert_int_equal(orb_asset_transforms(ctx, &made.supermesh, made.shapes, ORB_FIT_SIMILARITY, m, reports), ORB_OK);
  assert_true(m[16 + 4 * 2] / reports[1].scale < -0.1);
  synthetic_free(ctx, &made);
}

/* A pear, and a wider one, rotated by these degrees and three times as large. */
static double mistaken_degrees;
static void mistaken_copy(int32_t shape, const double p[3], double out[3]) {
  const double q[3] = {p[0] * (1.2 - p[1]), 2 * p[1], p[2] * (1.2 - p[1])};
  const double turn = shape ? mistaken_degrees * M_PI / 180 : 0, scale = shape ? 3 : 1, wide = shape ? 1.5 : 1;
  out[0] = scale * wide * (cos(turn) * q[0] - sin(turn) * q[1]);
  out[1] = scale * (sin(turn) * q[0] + cos(turn) * q[1]);
  out[2] = scale * q[2];
}

/* A match that may be wrong only scales a shape and does not rotate it, unless the shape is a copy of the other one, in
 * any rotation, the rotation is that of other axes, or the shape would collapse on the way without it. */
static void an_unsure_match_rotates_nothing(void **state) {
  orb_context *ctx = *state;
  static const struct {
    void (*copy)(int32_t shape, const double p[3], double out[3]);
    orb_fit fit;
    double degrees, least, most;
  } cases[] = {{mistaken_copy, ORB_FIT_AUTO, 50, 30, 180},          {mistaken_copy, ORB_FIT_AUTO_UNSURE, 50, 0, 0},
               {mistaken_copy, ORB_FIT_AUTO_UNSURE, 84, 90, 90},    {mistaken_copy, ORB_FIT_AUTO_UNSURE, 66, 0, 0},
               {mistaken_copy, ORB_FIT_AUTO_UNSURE, 150, 120, 180}, {placed_copy, ORB_FIT_AUTO_UNSURE, 50, 30, 180}};
  copy_scale = 3, copy_turn = 50, copy_axis = 2, copy_shift = 0;
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    mistaken_degrees = cases[i].degrees;
    synthetic made = synthetic_make(ctx, 3, 2, cases[i].copy);
    orb_fit_report reports[2];
    double m[32];
    assert_int_equal(orb_asset_transforms(ctx, &made.supermesh, made.shapes, cases[i].fit, m, reports), ORB_OK);
    assert_int_equal(reports[1].kind, ORB_FIT_SIMILARITY);
    assert_true(reports[1].scale > 1 / 4.5 && reports[1].scale < 1 / 2.9);
    if (cases[i].most == 0) {
      assert_true(reports[1].rotation_degrees == 0 && reports[1].up_degrees == 0);
    } else {
      assert_true(reports[1].rotation_degrees >= cases[i].least - 1e-6);
      assert_true(reports[1].rotation_degrees <= cases[i].most + 1e-6);
    }
    synthetic_free(ctx, &made);
  }
}

/* The matrix of that copy is the inverse of its transform. The first shape, and every shape without a fit, stays. */
static void the_transform_is_the_inverse(void **state) {
  orb_context *ctx = *state;
  synthetic made = synthetic_make(ctx, 3, 2, moved_copy);
  double m[32];
  static const double stay[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  assert_int_equal(orb_asset_transforms(ctx, &made.supermesh, made.shapes, ORB_FIT_NONE, m, NULL), ORB_OK);
  for (int i = 0; i < 32; i++) {
    assert_true(m[i] == stay[i % 16]);
  }
  assert_int_equal(orb_asset_transforms(ctx, &made.supermesh, made.shapes, ORB_FIT_SIMILARITY, m, NULL), ORB_OK);
  double c = cos(2.1) / 3, d = sin(2.1) / 3, shift[3] = {5, -7, 1};
  double turn[3][3] = {{c, d, 0}, {-d, c, 0}, {0, 0, 1.0 / 3}};
  for (int i = 0; i < 16; i++) {
    assert_true(m[i] == stay[i]);
  }
  for (int row = 0; row < 3; row++) {
    double moved = 0;
    for (int column = 0; column < 3; column++) {
      assert_true(fabs(m[16 + 4 * column + row] - turn[row][column]) < 1e-9);
      moved -= turn[row][column] * shift[column];
    }
    assert_true(fabs(m[28 + row] - moved) < 1e-8);
    assert_true(m[16 + 4 * row + 3] == 0);
  }
  assert_true(m[31] == 1);
  assert_int_equal(orb_asset_transforms(ctx, &made.supermesh, made.shapes, ORB_FIT_RIGID, m, NULL), ORB_OK);
  for (int column = 0; column < 3; column++) {
    const double *a = m + 16 + 4 * column;
    assert_true(fabs(a[0] * a[0] + a[1] * a[1] + a[2] * a[2] - 1) < 1e-12);
  }
  synthetic_free(ctx, &made);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(fit_undoes_a_similarity, asset_setup, asset_teardown),
      cmocka_unit_test_setup_teardown(auto_leaves_a_posture, asset_setup, asset_teardown),
      cmocka_unit_test_setup_teardown(an_unsure_match_rotates_nothing, asset_setup, asset_teardown),
      cmocka_unit_test_setup_teardown(the_transform_is_the_inverse, asset_setup, asset_teardown),
      cmocka_unit_test_setup_teardown(auto_fits_what_clearly_differs, asset_setup, asset_teardown),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
