/* The as-rigid-as-possible path: exact ends, rotations without shrinking, tent weights in the asset. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"
#include "numeric/vec3.h"
#include "support_shapes.h"
#include "support_supermesh.h"
#include "transfer/arap.h"

static int setup(void **state) {
  return orb_context_create(NULL, (orb_context **)state) == ORB_OK ? 0 : -1;
}
static int teardown(void **state) {
  orb_context_destroy(*state);
  return 0;
}

static void turn(double *p, double angle) {
  double x = p[0], y = p[1];
  p[0] = cos(angle) * x - sin(angle) * y;
  p[1] = sin(angle) * x + cos(angle) * y;
}

/* A body rotated by 170 degrees and shifted: at each t all edges have their length, and the angle grows evenly. */
static void a_rotated_body_stays_rigid(void **state) {
  orb_context *ctx = *state;
  orb_mesh ball = shape_ball(ctx, 3);
  int32_t n = ball.vertex_count;
  double *b = ORB_NEW(ctx, double, 3 * n), *at = ORB_NEW(ctx, double, 3 * n), angle = 170 * M_PI / 180;
  for (int32_t v = 0; v < n; v++) {
    ball.positions[3 * v] *= 3; /* elongated, so that its rotation is visible */
    memcpy(b + 3 * v, ball.positions + 3 * v, 3 * sizeof *b);
    turn(b + 3 * v, angle);
    b[3 * v + 2] += 5;
  }
  orb_arap *path;
  assert_int_equal(orb_arap_create(ctx, ball.positions, b, n, ball.triangles, ball.triangle_count, &path), ORB_OK);
  for (int k = 0; k <= 4; k++) {
    double t = k / 4.0;
    assert_int_equal(orb_arap_at(ctx, path, t, at), ORB_OK);
    for (int32_t v = 0; v < n; v++) {
      double wanted[3];
      memcpy(wanted, ball.positions + 3 * v, sizeof wanted);
      turn(wanted, t * angle);
      wanted[2] += 5 * t;
      assert_true(orb_distance2(wanted, at + 3 * v) < 1e-8);
    }
    float normal[3], up[3] = {1, 0, 0}, end[3] = {(float)cos(angle), (float)sin(angle), 0};
    orb_arap_direction(path, t, 0, up, end, normal);
    assert_true(fabs((double)normal[0] - cos(t * angle)) < 1e-5 && fabs((double)normal[1] - sin(t * angle)) < 1e-5);
  }
  orb_arap_destroy(ctx, path);
  orb_free(ctx, b);
  orb_free(ctx, at);
  shape_free(ctx, &ball);
}

/* A bar along z whose upper half bends by 120 degrees around the joint at its middle. Halfway, the tip is still half a
 * bar from the joint (a linear blend halves that distance). */
static void a_bending_limb_keeps_its_length(void **state) {
  orb_context *ctx = *state;
  orb_mesh bar = shape_cylinder(ctx, 12, 40, 20);
  int32_t n = bar.vertex_count, top = 0, bottom = 0;
  double *b = ORB_NEW(ctx, double, 3 * n), *at = ORB_NEW(ctx, double, 3 * n);
  double low = INFINITY, high = -INFINITY, middle;
  for (int32_t v = 0; v < n; v++) {
    if (bar.positions[3 * v + 2] > high) {
      high = bar.positions[3 * v + 2];
      top = v;
    }
    if (bar.positions[3 * v + 2] < low) {
      low = bar.positions[3 * v + 2];
      bottom = v;
    }
  }
  middle = 0.5 * (low + high);
  for (int32_t v = 0; v < n; v++) {
    const double *p = bar.positions + 3 * v;
    double z = p[2] - middle, share = fmin(1, fmax(0, 0.5 + z / 4)); /* bends over a length of 4 */
    double angle = share * 120 * M_PI / 180, arc = 120 * M_PI / 180 / 4, radius = 1 / arc;
    double along = z < -2 ? z + 2 : z > 2 ? z - 2 : 0;
    /* the centre line: straight, an arc of equal length, straight */
    double x = radius * (1 - cos(angle)) + (z > 2 ? along * sin(angle) : 0);
    double y = radius * sin(angle) + (z > 2 ? along * cos(angle) : z < -2 ? along : 0);
    b[3 * v] = x + p[0] * cos(angle);
    b[3 * v + 1] = p[1];
    b[3 * v + 2] = y - p[0] * sin(angle);
  }
  orb_arap *path;
  assert_int_equal(orb_arap_create(ctx, bar.positions, b, n, bar.triangles, bar.triangle_count, &path), ORB_OK);
  assert_int_equal(orb_arap_at(ctx, path, 0.5, at), ORB_OK);
  /* The centre line bent by 60 degrees over the same arc: the distance between its ends. */
  double half = 60 * M_PI / 180, r = 4 / half, leg = (high - low) / 2 - 2;
  double dx = r * (1 - cos(half)) + leg * sin(half), dy = r * sin(half) + leg * cos(half) + leg;
  double wanted = sqrt(dx * dx + dy * dy), got = sqrt(orb_distance2(at + 3 * top, at + 3 * bottom));
  double straight[2][3];
  for (int c = 0; c < 3; c++) {
    straight[0][c] = 0.5 * (bar.positions[3 * top + c] + b[3 * top + c]);
    straight[1][c] = 0.5 * (bar.positions[3 * bottom + c] + b[3 * bottom + c]);
  }
  double blended = sqrt(orb_distance2(straight[0], straight[1]));
  assert_true(fabs(got - wanted) < 0.03 * wanted);
  assert_true(fabs(blended - wanted) > 0.05 * wanted);
  /* No triangle loses more than a fifth of the mean of its areas at both ends. */
  for (int32_t t = 0; t < bar.triangle_count; t++) {
    double area[3];
    const double *from[3] = {bar.positions, at, b};
    for (int i = 0; i < 3; i++) {
      double u[3], w[3], normal[3];
      orb_sub(from[i] + 3 * bar.triangles[3 * t + 1], from[i] + 3 * bar.triangles[3 * t], u);
      orb_sub(from[i] + 3 * bar.triangles[3 * t + 2], from[i] + 3 * bar.triangles[3 * t], w);
      orb_cross(u, w, normal);
      area[i] = orb_length(normal);
    }
    assert_true(area[1] > 0.8 * 0.5 * (area[0] + area[2]));
  }
  orb_arap_destroy(ctx, path);
  orb_free(ctx, b);
  orb_free(ctx, at);
  shape_free(ctx, &bar);
}

static void waves(int32_t shape, const double p[3], double out[3]) {
  out[0] = p[0] * (1 + 0.3 * shape);
  out[1] = p[1] + 0.4 * p[0] * p[0] * shape;
  out[2] = p[2];
}

/* Three shapes and two in-betweens per gap give 2 + 4 targets. At most two weights are nonzero at a time and they sum
 * to at most 1; from shape 0 to shape 1 the in-betweens come in order. */
static void in_betweens_have_tent_weights(void **state) {
  orb_context *ctx = *state;
  synthetic made = synthetic_make(ctx, 2, 3, waves);
  orb_asset_options options;
  orb_asset_defaults(&options);
  options.path = ORB_PATH_RIGID;
  options.path_steps = 2;
  static const char *const names[] = {"a", "b", "c"};
  orb_buffer bytes = {0};
  orb_asset_facts facts;
  assert_int_equal(orb_asset_write(ctx, &made.supermesh, made.shapes, names, &options, &facts, &bytes), ORB_OK);
  assert_int_equal(facts.target_count, 6);
  glb file = glb_open(&bytes);
  const cJSON *mesh = cJSON_GetArrayItem(cJSON_GetObjectItem(file.json, "meshes"), 0);
  const cJSON *target_names = cJSON_GetObjectItem(cJSON_GetObjectItem(mesh, "extras"), "targetNames");
  static const char *const wanted[] = {"b", "c", "a to b 1/3", "a to b 2/3", "b to c 1/3", "b to c 2/3"};
  for (int i = 0; i < 6; i++) {
    assert_string_equal(cJSON_GetArrayItem(target_names, i)->valuestring, wanted[i]);
  }
  const cJSON *animation = cJSON_GetArrayItem(cJSON_GetObjectItem(file.json, "animations"), 0);
  const cJSON *sampler = cJSON_GetArrayItem(cJSON_GetObjectItem(animation, "samplers"), 0);
  int output = glb_attribute(sampler, "output"), input = glb_attribute(sampler, "input");
  /* the frames in turn: a a · · b b · · c c · · b b · · a */
  static const int frames[] = {-1, -1, 2, 3, 0, 0, 4, 5, 1, 1, 5, 4, 0, 0, 3, 2, -1};
  assert_int_equal(glb_count(&file, input), 17);
  for (int k = 0; k < 17; k++) {
    for (int i = 0; i < 6; i++) {
      assert_true(glb_value(&file, output, 6 * k + i, 0) == (i == frames[k] ? 1 : 0));
    }
    assert_true(k == 0 || glb_value(&file, input, k, 0) > glb_value(&file, input, k - 1, 0));
  }
  glb_close(&file);
  orb_buffer_free(ctx, &bytes);
  options.path_steps = 0;
  assert_int_equal(orb_asset_write(ctx, &made.supermesh, made.shapes, names, &options, &facts, &bytes),
                   ORB_E_BAD_OPTION);
  synthetic_free(ctx, &made);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(a_rotated_body_stays_rigid, setup, teardown),
      cmocka_unit_test_setup_teardown(a_bending_limb_keeps_its_length, setup, teardown),
      cmocka_unit_test_setup_teardown(in_betweens_have_tent_weights, setup, teardown),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
