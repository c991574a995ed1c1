/* Merges two embedded shapes into the asset. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"
#include "orbmorph/merge.h"
#include "support_shapes.h"
#include "support_supermesh.h"

typedef struct stages {
  char seen[64];
} stages;

/* The first letter of each stage as it begins: a(lign), r(emesh), t(ransfer), w(rite). */
static void on_progress(void *user, const char *stage, double fraction) {
  stages *all = user;
  size_t length = strlen(all->seen);
  assert_true(fraction >= 0 && fraction <= 1);
  if (length + 1 < sizeof all->seen && (length == 0 || all->seen[length - 1] != stage[0])) {
    all->seen[length] = stage[0];
  }
}

static void stretch(orb_mesh *mesh, double x, double y, double z) {
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    mesh->positions[3 * v] *= x;
    mesh->positions[3 * v + 1] *= y;
    mesh->positions[3 * v + 2] *= z;
  }
}

/* The vertex nearest to a direction. */
static int32_t vertex_at(const orb_mesh *mesh, const double *points, double x, double y, double z) {
  int32_t best = 0;
  double most = -2;
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    double dot = points[3 * v] * x + points[3 * v + 1] * y + points[3 * v + 2] * z;
    if (dot > most) {
      most = dot;
      best = v;
    }
  }
  return best;
}

static void two_ellipsoids(void **state) {
  (void)state;
  stages all = {{0}};
  orb_context *ctx;
  orb_context_options with = {.progress = on_progress, .progress_user = &all};
  assert_int_equal(orb_context_create(&with, &ctx), ORB_OK);
  orb_mesh meshes[2] = {shape_ball(ctx, 3), shape_globe(ctx, 24, 12)};
  double *points[2];
  for (int s = 0; s < 2; s++) {
    points[s] = ORB_NEW(ctx, double, 3 * meshes[s].vertex_count);
    memcpy(points[s], meshes[s].positions, 3 * (size_t)meshes[s].vertex_count * sizeof(double));
  }
  stretch(&meshes[0], 2, 1, 1);
  stretch(&meshes[1], 1, 3, 1);
  static const double at[4][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-1, 0, 0}};
  orb_place places[4][2];
  orb_landmark landmarks[4];
  memset(landmarks, 0, sizeof landmarks);
  for (int i = 0; i < 4; i++) {
    for (int s = 0; s < 2; s++) {
      int32_t v = vertex_at(&meshes[s], points[s], at[i][0], at[i][1], at[i][2]);
      assert_int_equal(orb_place_of_vertex(ctx, &meshes[s], v, &places[i][s]), ORB_OK);
    }
    landmarks[i].at = places[i];
    landmarks[i].confidence = 1;
  }
  orb_align_shape shapes[2] = {{&meshes[0], points[0]}, {&meshes[1], points[1]}};
  const char *names[2] = {"long", "tall"};
  orb_merge_options options;
  orb_merge_defaults(&options);
  options.remesh.method = ORB_REMESH_SUBDIVISION;
  orb_merge_result result;
  orb_status status = orb_merge(ctx, shapes, names, 2, landmarks, 4, &options, &result);
  if (status != ORB_OK) {
    fail_msg("%s", orb_context_error(ctx)->detail);
  }
  const orb_supermesh *supermesh = &result.supermesh;
  assert_int_equal(supermesh->triangle_count, 2 * supermesh->vertex_count - 4);
  assert_int_equal(result.asset_facts.triangle_count, supermesh->triangle_count);
  assert_int_equal(result.pair_count, 1);
  assert_true(result.pairs[0].a == 0 && result.pairs[0].b == 1);
  assert_true(result.pairs[0].distortion.symmetric_dirichlet.mean > 1);
  assert_true(result.pairs[0].inverted_fraction < 0.01);
  for (int i = 0; i < 8; i++) {
    assert_true(result.landmark_residuals[i] < 1e-12);
  }
  assert_true(fabs(result.shapes[0].diagonal - 2 * sqrt(6)) < 1e-12);
  assert_true(result.shapes[0].hausdorff_sampled < 0.02 * result.shapes[0].diagonal);
  assert_true(result.shapes[1].hausdorff_sampled < 0.02 * result.shapes[1].diagonal);
  double parts = result.timings.align + result.timings.remesh + result.timings.transfer + result.timings.write;
  assert_true(fabs(parts - result.timings.total) < 1e-6);
  assert_string_equal(all.seen, "artw"); /* the alignment embeds again, without reporting those stages */
  /* Each landmark is one vertex of the file, at the landmark's place on both shapes up to float32. */
  glb file = glb_open(&result.asset);
  const cJSON *mesh = cJSON_GetArrayItem(cJSON_GetObjectItem(file.json, "meshes"), 0);
  const cJSON *primitive = cJSON_GetArrayItem(cJSON_GetObjectItem(mesh, "primitives"), 0);
  int base = glb_attribute(cJSON_GetObjectItem(primitive, "attributes"), "POSITION");
  int delta = glb_attribute(cJSON_GetArrayItem(cJSON_GetObjectItem(primitive, "targets"), 0), "POSITION");
  for (int i = 0; i < 4; i++) {
    double wanted[2][3];
    int found = 0;
    orb_place_position(&meshes[0], &places[i][0], wanted[0]);
    orb_place_position(&meshes[1], &places[i][1], wanted[1]);
    for (int v = 0; v < glb_count(&file, base); v++) {
      int here = 1;
      for (int c = 0; c < 3; c++) {
        double p = glb_value(&file, base, v, c);
        here &= fabs(p - wanted[0][c]) < 1e-6 && fabs(p + glb_value(&file, delta, v, c) - wanted[1][c]) < 1e-6;
      }
      found += here;
    }
    assert_int_equal(found, 1);
  }
  glb_close(&file);
  orb_merge_result_free(ctx, &result);
  for (int s = 0; s < 2; s++) {
    orb_free(ctx, points[s]);
    shape_free(ctx, &meshes[s]);
  }
  orb_context_destroy(ctx);
}

static void one_shape_is_refused(void **state) {
  (void)state;
  orb_context *ctx;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  orb_mesh ball = shape_ball(ctx, 1);
  orb_align_shape shape = {&ball, ball.positions};
  const char *name = "alone";
  orb_merge_options options;
  orb_merge_defaults(&options);
  orb_merge_result result;
  assert_int_equal(orb_merge(ctx, &shape, &name, 1, NULL, 0, &options, &result), ORB_E_BAD_OPTION);
  shape_free(ctx, &ball);
  orb_context_destroy(ctx);
}

/* If all vertices of either shape are at one place, the merge is refused. */
static void shapes_of_no_size_are_refused(void **state) {
  (void)state;
  orb_context *ctx;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  orb_mesh ball = shape_ball(ctx, 1), speck = shape_ball(ctx, 1);
  orb_align_shape shapes[3] = {{&speck, ball.positions}, {&ball, ball.positions}, {&speck, ball.positions}};
  const char *names[2] = {"one", "other"};
  orb_merge_options options;
  orb_merge_defaults(&options);
  options.align.method = ORB_ALIGN_ROTATE;
  stretch(&speck, 0, 0, 0);
  for (int32_t i = 0; i < speck.vertex_count; i++) {
    speck.positions[3 * i] = 7;
  }
  for (int32_t first = 0; first < 2; first++) {
    orb_merge_result result;
    assert_int_equal(orb_merge(ctx, shapes + first, names, 2, NULL, 0, &options, &result), ORB_E_DEGENERATE);
    assert_int_equal(orb_context_error(ctx)->shape, first);
  }
  shape_free(ctx, &speck);
  shape_free(ctx, &ball);
  orb_context_destroy(ctx);
}

/* An overlay reproduces both surfaces exactly, however crumpled they are, so none of its triangles is inverted. Smooth
 * normals alone would call two fifths inverted. */
static void an_overlay_of_crumpled_shapes_inverts_nothing(void **state) {
  (void)state;
  orb_context *ctx;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  orb_mesh ball = shape_ball(ctx, 3), globe = shape_globe(ctx, 24, 12);
  orb_mesh crumpled[2] = {shape_ball(ctx, 3), shape_globe(ctx, 24, 12)};
  orb_align_shape shapes[2] = {{&crumpled[0], ball.positions}, {&crumpled[1], globe.positions}};
  const char *names[2] = {"one", "other"};
  uint32_t seed = 1;
  for (int s = 0; s < 2; s++) {
    for (int32_t i = 0; i < 3 * crumpled[s].vertex_count; i++) {
      seed = seed * 1664525u + 1013904223u;
      crumpled[s].positions[i] += 0.5 * ((seed >> 8) / 8388608.0 - 1);
    }
  }
  orb_merge_options options;
  orb_merge_defaults(&options);
  options.align.method = ORB_ALIGN_ROTATE;
  options.remesh.method = ORB_REMESH_OVERLAY;
  orb_merge_result result;
  assert_int_equal(orb_merge(ctx, shapes, names, 2, NULL, 0, &options, &result), ORB_OK);
  assert_true(result.pairs[0].inverted_fraction == 0);
  orb_merge_result_free(ctx, &result);
  for (int s = 0; s < 2; s++) {
    shape_free(ctx, &crumpled[s]);
  }
  shape_free(ctx, &globe);
  shape_free(ctx, &ball);
  orb_context_destroy(ctx);
}

/* Each ellipsoid is three times as long as the one before, which no warning tells; the last one is 81 times as long as
 * the first. So the map that is wrong is not one between neighbours. */
static void maps_of_the_first_of_many_shapes_are_reported(void **state) {
  (void)state;
  enum { SHAPES = 5 };
  orb_context *ctx;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  orb_mesh ball = shape_ball(ctx, 3), longer[SHAPES];
  orb_align_shape shapes[SHAPES];
  const char *names[SHAPES] = {"1", "3", "9", "27", "81"};
  orb_place places[4][SHAPES];
  orb_landmark landmarks[4] = {0};
  static const double at[4][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-1, 0, 0}};
  for (int s = 0; s < SHAPES; s++) {
    longer[s] = shape_ball(ctx, 3);
    stretch(&longer[s], pow(3, s), 1, 1);
    shapes[s] = (orb_align_shape){&longer[s], ball.positions};
    for (int i = 0; i < 4; i++) {
      const int32_t v = vertex_at(&ball, ball.positions, at[i][0], at[i][1], at[i][2]);
      assert_int_equal(orb_place_of_vertex(ctx, &longer[s], v, &places[i][s]), ORB_OK);
      landmarks[i].at = places[i];
    }
  }
  orb_merge_options options;
  orb_merge_defaults(&options);
  options.align.method = ORB_ALIGN_ROTATE;
  options.remesh.method = ORB_REMESH_SUBDIVISION;
  orb_merge_result result;
  assert_int_equal(orb_merge(ctx, shapes, names, SHAPES, landmarks, 4, &options, &result), ORB_OK);
  static const int32_t pairs[][2] = {{0, 1}, {0, 2}, {0, 3}, {0, 4}, {1, 2}, {2, 3}, {3, 4}};
  assert_int_equal(result.pair_count, 7);
  for (int i = 0; i < 7; i++) {
    assert_true(result.pairs[i].a == pairs[i][0] && result.pairs[i].b == pairs[i][1]);
  }
  int last = 0;
  for (int32_t i = 0; i < result.warning_count; i++) {
    last += result.warnings[i].kind == ORB_WARNING_STRETCHED && result.warnings[i].a == 0 && result.warnings[i].b == 4;
    assert_int_equal(result.warnings[i].a, 0);
  }
  assert_int_equal(last, 1);
  orb_merge_result_free(ctx, &result);
  for (int s = 0; s < SHAPES; s++) {
    shape_free(ctx, &longer[s]);
  }
  shape_free(ctx, &ball);
  orb_context_destroy(ctx);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(two_ellipsoids), cmocka_unit_test(one_shape_is_refused),
                                     cmocka_unit_test(shapes_of_no_size_are_refused),
                                     cmocka_unit_test(an_overlay_of_crumpled_shapes_inverts_nothing),
                                     cmocka_unit_test(maps_of_the_first_of_many_shapes_are_reported)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
