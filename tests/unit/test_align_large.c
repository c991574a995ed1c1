/* Large shapes, which are aligned as decimated copies: the result is of the whole shapes, and their map is right. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "align/map/compose.h"
#include "align/map/engine/params.h"
#include "align/sheet/copies.h"
#include "base/memory.h"
#include "numeric/vec3.h"
#include "orbmorph/locate.h"
#include "support_align.h"
#include "support_shapes.h"

enum { SHAPES = 3, LANDMARKS = 6 };

/* A ball with five bumps, without symmetries: the same surface in several triangulations. */
typedef struct scene {
  orb_context *ctx;
  orb_mesh mesh[SHAPES];
  orb_embedding embedding[SHAPES];
  orb_align_shape shape[SHAPES];
  orb_place at[LANDMARKS][SHAPES];
  orb_landmark landmark[LANDMARKS];
} scene;

static const double BUMPS[][5] = {/* direction, height, sharpness */
                                  {0.1, 0.2, 1, 1.1, 7},
                                  {1, 0.3, -0.2, 0.7, 9},
                                  {-0.7, 0.8, -0.1, 0.9, 12},
                                  {-0.3, -1, 0.4, 0.5, 10},
                                  {0.3, -0.2, -1, 0.8, 8}};

static void raise(orb_mesh *mesh) {
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    double *p = mesh->positions + 3 * (size_t)v, radius = 1;
    (void)orb_normalize(p);
    for (size_t i = 0; i < sizeof BUMPS / sizeof *BUMPS; i++) {
      double d[3];
      memcpy(d, BUMPS[i], sizeof d);
      (void)orb_normalize(d);
      radius += BUMPS[i][3] * exp(-BUMPS[i][4] * (1 - orb_dot(p, d)));
    }
    for (int k = 0; k < 3; k++) {
      p[k] *= radius;
    }
  }
}

static int32_t vertex_at(const orb_mesh *mesh, const double direction[3]) {
  int32_t best = 0;
  double most = -INFINITY;
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    const double *p = mesh->positions + 3 * (size_t)v;
    double along = orb_dot(p, direction) / orb_length(p);
    if (along > most) {
      most = along;
      best = v;
    }
  }
  return best;
}

/* Landmarks at the bumps, and one at a place between them. */
static void set_landmarks(scene *s) {
  for (int l = 0; l < LANDMARKS; l++) {
    const double between[3] = {0.5, 0.8, 0.4};
    double d[3];
    memcpy(d, l < LANDMARKS - 1 ? BUMPS[l] : between, sizeof d);
    (void)orb_normalize(d);
    s->landmark[l].at = s->at[l];
    for (int k = 0; k < SHAPES; k++) {
      assert_int_equal(orb_place_of_vertex(s->ctx, &s->mesh[k], vertex_at(&s->mesh[k], d), &s->at[l][k]), ORB_OK);
    }
  }
}

static void open_scene(scene *s) {
  memset(s, 0, sizeof *s);
  assert_int_equal(orb_context_create(NULL, &s->ctx), ORB_OK);
  s->mesh[0] = shape_globe(s->ctx, 70, 40);
  s->mesh[1] = shape_globe(s->ctx, 110, 90);
  s->mesh[2] = shape_globe(s->ctx, 96, 100);
  for (int k = 0; k < SHAPES; k++) {
    orb_embed_options options;
    orb_embed_defaults(&options);
    raise(&s->mesh[k]);
    assert_int_equal(orb_embed(s->ctx, &s->mesh[k], &options, &s->embedding[k]), ORB_OK);
    s->shape[k] = (orb_align_shape){&s->mesh[k], s->embedding[k].points};
    assert_true(k == 0 || s->mesh[k].vertex_count > orb_map_params_of(ORB_PRESET_DEFAULT).copies.large);
  }

  set_landmarks(s);
}

static void close_scene(scene *s) {
  for (int k = 0; k < SHAPES; k++) {
    shape_free(s->ctx, &s->mesh[k]);
    orb_embedding_free(s->ctx, &s->embedding[k]);
  }
  orb_context_destroy(s->ctx);
}

static double angle_to(const orb_alignment *a, int k, const orb_locator *locator, int32_t v) {
  const double *p = a->shapes[0].mesh.positions + 3 * (size_t)v;
  orb_place place;
  double q[3];
  orb_locate(locator, a->shapes[0].points + 3 * (size_t)v, -1, &place);
  orb_place_position(&a->shapes[k].mesh, &place, q);
  return acos(fmin(1, orb_dot(p, q) / orb_length(p) / orb_length(q)));
}

/* The angle between the directions of a vertex of the first shape and of its image on shape k; the mean over all
 * vertices if v is −1. */
static double angle_from(const scene *s, const orb_alignment *a, int k, int32_t v) {
  const orb_aligned_shape *to = &a->shapes[k];
  const int32_t count = a->shapes[0].mesh.vertex_count;
  orb_locator *locator;
  double sum = 0;
  assert_int_equal(orb_locator_create(s->ctx, to->points, to->mesh.vertex_count, to->mesh.triangles,
                                      to->mesh.triangle_count, NULL, &locator),
                   ORB_OK);
  for (int32_t i = 0; v < 0 && i < count; i++) {
    sum += angle_to(a, k, locator, i) / count;
  }
  sum = v < 0 ? sum : angle_to(a, k, locator, v);
  orb_locator_destroy(s->ctx, locator);
  return sum;
}

/* The surfaces are the same up to their triangles: the map is near the identity. */
static void check_map(const scene *s, const orb_alignment *a, int shapes) {
  for (int k = 1; k < shapes; k++) {
    assert_true(a->shapes[k].mesh.vertex_count >= s->mesh[k].vertex_count);
    assert_true(angle_from(s, a, k, -1) < 0.02);
  }
  assert_true(a->energy < 1.05);
}

static orb_align_options options_of(orb_align_method method) {
  orb_align_options options;
  orb_align_defaults(&options);
  options.method = method;
  options.preset = ORB_PRESET_DEFAULT;
  return options;
}

static void whole_shapes_meet_at_landmarks(void **state) {
  (void)state;
  scene s;
  orb_alignment a;
  open_scene(&s);
  const orb_align_options options = options_of(ORB_ALIGN_PIN);
  align_and_check(s.ctx, s.shape, SHAPES, s.landmark, LANDMARKS, &options, &a);
  for (int l = 0; l < LANDMARKS; l++) {
    for (int k = 0; k < SHAPES; k++) {
      const orb_aligned_shape *shape = &a.shapes[k];
      double given[3];
      orb_place_position(&s.mesh[k], &s.at[l][k], given);
      assert_memory_equal(shape->mesh.positions + 3 * (size_t)shape->landmark_vertices[l], given, sizeof given);
    }
  }
  check_map(&s, &a, SHAPES);
  orb_alignment_free(s.ctx, &a);
  close_scene(&s);
}

/* A soft landmark 20° off its place pulls the map less than half as far. */
static void soft_landmarks_are_let_go(void **state) {
  (void)state;
  scene s;
  orb_alignment a;
  open_scene(&s);
  const orb_align_options options = options_of(ORB_ALIGN_PIN);
  const double between[3] = {0.5, 0.8, 0.4};
  const double off[3] = {0.75, 0.65, 0.1};
  s.landmark[LANDMARKS - 1].weight = 0.02;
  assert_int_equal(orb_place_of_vertex(s.ctx, &s.mesh[1], vertex_at(&s.mesh[1], off), &s.at[LANDMARKS - 1][1]), ORB_OK);
  assert_int_equal(orb_align(s.ctx, s.shape, 2, s.landmark, LANDMARKS, &options, &a), ORB_OK);
  check_alignment(&a, 0);
  assert_int_equal(a.shapes[0].landmark_vertices[LANDMARKS - 1], -1);
  assert_int_equal(a.shapes[1].landmark_vertices[LANDMARKS - 1], -1);
  assert_memory_equal(a.shapes[0].points + 3 * (size_t)a.shapes[0].landmark_vertices[0],
                      a.shapes[1].points + 3 * (size_t)a.shapes[1].landmark_vertices[0], sizeof(double[3]));
  assert_true(angle_from(&s, &a, 1, vertex_at(&s.mesh[0], between)) < 10 * M_PI / 180);
  assert_true(a.energy < 1.05);
  orb_alignment_free(s.ctx, &a);
  close_scene(&s);
}

/* Found landmarks and alternatives are places on the given meshes, not on the copies. The first shape is stretched, so
 * the search begins at it, and a copy stands for the second one. */
static void whole_shapes_have_the_places(void **state) {
  (void)state;
  scene s;
  orb_alignment a;
  orb_extent extent[2];
  open_scene(&s);
  for (int32_t v = 0; v < s.mesh[0].vertex_count; v++) {
    s.mesh[0].positions[3 * (size_t)v + 2] *= 1.01;
  }
  for (int k = 0; k < 2; k++) {
    orb_mesh_extent(&s.mesh[k], &extent[k]);
  }
  assert_true(extent[0].volume / pow(extent[0].area, 1.5) < extent[1].volume / pow(extent[1].area, 1.5));
  const orb_align_options options = options_of(ORB_ALIGN_AUTO);
  align_and_check(s.ctx, s.shape, 2, NULL, 0, &options, &a);
  check_map(&s, &a, 2);
  assert_int_equal(a.shapes[1].mesh.vertex_count, s.mesh[1].vertex_count);
  assert_true(a.found_count > 0);
  assert_true(a.match.is_measured);
  for (int32_t i = 0; i < a.alternative_count; i++) {
    const orb_alternative *one = &a.alternatives[i];
    for (int32_t k = 0; k < 2 * one->count; k++) {
      const orb_place *place = &one->at[k];
      assert_in_range(place->triangle, 0, s.mesh[k % 2].triangle_count - 1);
      assert_true(place->at[0] == 1 || place->at[1] == 1 || place->at[2] == 1);
    }
  }
  orb_alignment_free(s.ctx, &a);
  close_scene(&s);
}

/* Turns a point of the sphere about z, most at the equator: a map that is moved so has more energy than the identity.
 */
static void twist(const double p[3], double out[3]) {
  const double angle = 0.2 * (1 - p[2] * p[2]);
  out[0] = cos(angle) * p[0] - sin(angle) * p[1];
  out[1] = sin(angle) * p[0] + cos(angle) * p[1];
  out[2] = p[2];
}

/* What a copy's map has, because shapes fit in space or landmarks lie there, the whole shape keeps, though the identity
 * has less energy. Fixed and moving shape are the same, so a vertex that is not moved has the same point on both. */
static void a_lift_keeps_the_map_of_the_copy(void **state) {
  (void)state;
  const orb_map_params params = orb_map_params_of(ORB_PRESET_DEFAULT);
  const int32_t keep_until = orb_map_keep_until(&params, 0);
  scene s;
  orb_copies copies;
  double energy[2], far = 0, left = 0;
  int improved;
  open_scene(&s);
  const orb_align_shape shapes[2] = {s.shape[1], s.shape[1]};
  const size_t n = 3 * (size_t)s.mesh[1].vertex_count;
  assert_int_equal(
      orb_copies_create(s.ctx, shapes, 2, NULL, 0, orb_map_copy_size(&params, keep_until), keep_until, &copies),
      ORB_OK);
  orb_copied_shape *one = &copies.of[1];
  orb_coarse_copy *copy = &one->copy;
  orb_aligned_shape fixed = {.mesh = s.mesh[1], .points = orb_alloc(s.ctx, n, sizeof(double))};
  assert_non_null(fixed.points);
  memcpy(fixed.points, s.embedding[1].points, n * sizeof(double));
  for (int32_t v = 0; v < copy->mesh.vertex_count; v++) {
    twist(fixed.points + 3 * (size_t)copy->vertex[v], copy->points + 3 * (size_t)v);
  }
  const orb_map_guide guide = {.from = ORB_MAP_FROM_COPY,
                               .copy = {copy->mesh.vertex_count, copy->vertex, copy->points, &one->hierarchy, 0}};
  assert_int_equal(orb_compose(s.ctx, &fixed, &one->whole, 0, 0, &guide, ORB_PRESET_DEFAULT, energy, &improved),
                   ORB_OK);
  assert_true(improved);
  assert_true(energy[1] > 1.005);
  for (int32_t v = 0; v < copy->mesh.vertex_count; v++) {
    const double *twisted = copy->points + 3 * (size_t)v;
    const size_t at = 3 * (size_t)copy->vertex[v];
    far += sqrt(orb_distance2(fixed.points + at, twisted));
    left += sqrt(orb_distance2(one->whole.points + at, twisted));
  }
  assert_true(left < 0.1 * far);
  orb_free(s.ctx, fixed.points);
  orb_copies_free(s.ctx, &copies);
  close_scene(&s);
}

/* A failed allocation while the copies are made or lifted leaves nothing behind: the memory budget ends somewhere
 * within. */
static void memory_may_end(void **state) {
  (void)state;
  scene s;
  orb_alignment a;
  open_scene(&s);
  const orb_align_options options = options_of(ORB_ALIGN_PIN);
  for (size_t budget = (size_t)1 << 20; budget < (size_t)1 << 24; budget *= 2) {
    const orb_context_options limits = {.memory_limit = budget};
    orb_context *small;
    assert_int_equal(orb_context_create(&limits, &small), ORB_OK);
    assert_int_equal(orb_align(small, s.shape, SHAPES, s.landmark, LANDMARKS, &options, &a), ORB_E_NO_MEMORY);
    assert_null(a.shapes);
    orb_context_destroy(small);
  }
  close_scene(&s);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(whole_shapes_meet_at_landmarks), cmocka_unit_test(soft_landmarks_are_let_go),
      cmocka_unit_test(whole_shapes_have_the_places), cmocka_unit_test(a_lift_keeps_the_map_of_the_copy),
      cmocka_unit_test(memory_may_end)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
