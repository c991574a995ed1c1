/* Spheres that keep angles, places smoothed on a sphere, and crumples ironed. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "align/map/engine/iron.h"
#include "align/map/engine/unfold.h"
#include "align/map/starts/smooth.h"
#include "align/sheet/even.h"
#include "numeric/vec3.h"
#include "orbmorph/embed.h"
#include "support_shapes.h"

/* A ball with a long limb. No embedding on the sphere keeps its angles and its areas. */
static orb_mesh limbed(orb_context *ctx) {
  orb_mesh mesh = shape_globe(ctx, 40, 60);
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    double *p = mesh.positions + 3 * (size_t)v;
    (void)orb_normalize(p);
    const double out = 6 * exp(-40 * (1 - p[2]));
    p[2] += out;
  }
  return mesh;
}

static double mean_angle(orb_context *ctx, const orb_mesh *mesh, const double *points) {
  orb_distortion distortion;
  assert_int_equal(
      orb_distortion_measure(ctx, mesh->positions, points, mesh->triangles, mesh->triangle_count, &distortion), ORB_OK);
  return distortion.angle.mean;
}

/* The triangles are certified, and nearer to their own shapes than those of an embedding that keeps areas. */
static void angles_are_kept(void **state) {
  (void)state;
  orb_context *ctx;
  orb_embed_options options;
  orb_embedding embedding;
  orb_even_shapes even;
  orb_certificate certificate;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  orb_mesh mesh = limbed(ctx);
  orb_embed_defaults(&options);
  assert_int_equal(orb_embed(ctx, &mesh, &options, &embedding), ORB_OK);
  const orb_align_shape shape = {&mesh, embedding.points};
  assert_int_equal(orb_even_shapes_create(ctx, &shape, 1, &even), ORB_OK);
  assert_ptr_not_equal(even.shapes[0].points, embedding.points);
  assert_int_equal(
      orb_certify(ctx, even.shapes[0].points, mesh.vertex_count, mesh.triangles, mesh.triangle_count, &certificate),
      ORB_OK);
  assert_true(certificate.valid);
  assert_true(mean_angle(ctx, &mesh, even.shapes[0].points) < 0.8 * mean_angle(ctx, &mesh, embedding.points));
  orb_even_shapes_free(ctx, &even);
  orb_embedding_free(ctx, &embedding);
  shape_free(ctx, &mesh);
  orb_context_destroy(ctx);
}

/* A ball that is mapped to itself, and the points at which its vertices are placed. */
typedef struct scene {
  orb_context *ctx;
  orb_mesh mesh;
  orb_aligned_shape shape;
  orb_corner_table table;
  orb_map_run run;
  orb_map_level level;
  double *points;
} scene;

static void open_scene(scene *s) {
  memset(s, 0, sizeof *s);
  assert_int_equal(orb_context_create(NULL, &s->ctx), ORB_OK);
  s->mesh = shape_ball(s->ctx, 4);
  const size_t n = (size_t)s->mesh.vertex_count;
  s->points = malloc(3 * n * sizeof(double));
  assert_non_null(s->points);
  memcpy(s->points, s->mesh.positions, 3 * n * sizeof(double));
  s->shape = (orb_aligned_shape){.mesh = s->mesh, .points = s->mesh.positions};
  s->run = (orb_map_run){.ctx = s->ctx,
                         .params = orb_map_params_of(ORB_PRESET_DEFAULT),
                         .x = s->mesh.positions,
                         .position = malloc(3 * n * sizeof(double)),
                         .local = malloc(n * sizeof(int32_t)),
                         .doubted = calloc(n, 1),
                         .vertex_count = s->mesh.vertex_count};
  assert_true(s->run.position && s->run.local && s->run.doubted);
  assert_int_equal(orb_map_surface_create(s->ctx, &s->shape, &s->run.b), ORB_OK);
  assert_int_equal(orb_corner_table_create(s->ctx, &s->mesh, &s->table), ORB_OK);
}

static void close_scene(scene *s) {
  orb_map_level_free(s->ctx, &s->level);
  orb_corner_table_free(s->ctx, &s->table);
  orb_map_surface_free(s->ctx, &s->run.b);
  free(s->run.position);
  free(s->run.local);
  free(s->run.doubted);
  free(s->points);
  shape_free(s->ctx, &s->mesh);
  orb_context_destroy(s->ctx);
}

/* Places the vertices at s->points, smooths, and returns how far the worst one is from where it belongs. */
static double smooth(scene *s) {
  double far = 0;
  assert_int_equal(orb_map_full_level(&s->run, s->points, &s->table, &s->level), ORB_OK);
  assert_int_equal(orb_map_smooth(&s->run, &s->level, s->table.to_mesh), ORB_OK);
  for (int32_t v = 0; v < s->level.count; v++) {
    const int32_t u = s->table.to_mesh[s->level.vertex[v]];
    const double *x = s->level.x + 3 * (size_t)v, *home = s->mesh.positions + 3 * (size_t)u;
    double place[3];
    far = fmax(far, sqrt(orb_distance2(x, home)));
    orb_map_surface_at(&s->run.b, &s->level.place[v], NULL, place, NULL);
    assert_true(orb_distance2(place, x) < 1e-12); /* located where it is */
  }
  return far;
}

static void true_places_stay(void **state) {
  (void)state;
  scene s;
  open_scene(&s);
  assert_true(smooth(&s) < 1e-3);
  assert_int_equal(orb_map_level_flips(&s.level), 0);
  close_scene(&s);
}

/* Vertices that were placed on the other side of the ball, as happens where limbs touch, come back to their neighbours.
 */
static void outliers_come_back(void **state) {
  (void)state;
  scene s;
  open_scene(&s);
  for (int32_t v = 0; v < s.mesh.vertex_count; v += 29) {
    for (int k = 0; k < 3; k++) {
      s.points[3 * (size_t)v + (size_t)k] *= -1;
    }
  }
  assert_true(smooth(&s) < 0.1);
  assert_int_equal(orb_map_level_flips(&s.level), 0);
  close_scene(&s);
}

/* A cap whose places face another way goes where its rim draws it. Its places agree with each other, so they count
 * where nothing contradicts them. */
static void doubted_places_come_back(void **state) {
  (void)state;
  for (unsigned char doubted = 0; doubted < 2; doubted++) {
    scene s;
    open_scene(&s);
    for (int32_t v = 0; v < s.mesh.vertex_count; v++) {
      double *x = s.points + 3 * (size_t)v;
      for (int k = 0; k < 3 && s.mesh.positions[3 * (size_t)v + 2] > 0.9; k++) {
        x[k] *= -1;
        s.run.doubted[v] = doubted;
      }
    }
    const double far = smooth(&s);
    assert_true(doubted ? far < 0.1 : far > 1);
    assert_int_equal(orb_map_level_flips(&s.level) == 0, doubted);
    close_scene(&s);
  }
}

/* Noise as long as an edge folds triangles of a cap. Flipped triangles count less for their targets, and most of them
 * unfold. */
static void folds_open(void **state) {
  (void)state;
  scene s;
  uint32_t seed = 20161;
  open_scene(&s);
  for (int32_t v = 0; v < s.mesh.vertex_count; v++) {
    double *x = s.points + 3 * (size_t)v;
    for (int k = 0; k < 3 && x[2] > 0.5; k++) {
      seed = seed * 1664525U + 1013904223U;
      x[k] += 0.15 * (seed / 4294967296.0 - 0.5);
    }
    (void)orb_normalize(x);
  }
  assert_int_equal(orb_map_full_level(&s.run, s.points, &s.table, &s.level), ORB_OK);
  const int32_t before = orb_map_level_flips(&s.level);
  orb_map_level_free(s.ctx, &s.level);
  (void)smooth(&s);
  assert_true(before > 20);
  assert_true(orb_map_level_flips(&s.level) < before / 2);
  close_scene(&s);
}

/* A cap that is torn and unfolded has a crumple in the middle of the identity, whose energy is 1. Ironing restores that
 * energy and moves nothing far from the crumple. */
static void crumples_are_ironed(void **state) {
  (void)state;
  scene s;
  uint32_t seed = 20161;
  int32_t left;
  open_scene(&s);
  s.run.work = INT64_MAX / 2;
  assert_int_equal(orb_map_packed_create(s.ctx, &s.mesh, &s.run.b, &s.run.packed), ORB_OK);
  assert_int_equal(orb_map_full_level(&s.run, s.points, &s.table, &s.level), ORB_OK);
  for (int32_t v = 0; v < s.level.count; v++) {
    double *x = s.level.x + 3 * (size_t)v;
    for (int k = 0; k < 3 && x[2] > 0.9; k++) {
      seed = seed * 1664525U + 1013904223U;
      x[k] += 0.6 * (seed / 4294967296.0 - 0.5);
    }
    (void)orb_normalize(x);
  }
  assert_int_equal(orb_map_level_unfold(s.ctx, &s.level, &left), ORB_OK);
  assert_int_equal(left, 0);
  assert_int_equal(orb_map_level_locate_all(s.ctx, &s.level, &s.run.b, 1), ORB_OK);
  const double crumpled = orb_map_level_energy(&s.level);
  assert_true(crumpled > 1.1);
  assert_int_equal(orb_map_iron(&s.run, &s.level), ORB_OK);
  print_message("energy %.3f, ironed %.3f\n", crumpled, orb_map_level_energy(&s.level));
  assert_true(orb_map_level_energy(&s.level) < 1.05);
  assert_int_equal(orb_map_level_flips(&s.level), 0);
  for (int32_t v = 0; v < s.level.count; v++) {
    const double *home = s.mesh.positions + 3 * (size_t)s.table.to_mesh[s.level.vertex[v]];
    assert_true(home[2] > 0 || orb_distance2(s.level.x + 3 * (size_t)v, home) < 1e-20);
    assert_false(s.level.pinned[v]);
  }
  orb_map_packed_free(s.ctx, &s.run.packed);
  close_scene(&s);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(angles_are_kept),    cmocka_unit_test(true_places_stay),
      cmocka_unit_test(outliers_come_back), cmocka_unit_test(doubted_places_come_back),
      cmocka_unit_test(folds_open),         cmocka_unit_test(crumples_are_ironed),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
