/* Rims of filled holes of two shapes: masks, busts and tubes whose rims the map of least energy leaves apart. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "mesh/holes.h"
#include "numeric/vec3.h"
#include "orbmorph/format.h"
#include "orbmorph/locate.h"
#include "support_align.h"
#include "support_context.h"
#include "support_shapes.h"

/* Of the diagonal: a rim vertex is on the other rim. Without matched rims one in three or fewer is. */
static const double NEAR = 0.005;

/* A ball without the caps of some half-angles around directions. */
typedef struct open_ball {
  int caps;
  double at[4][3], degrees[4];
  double scale[3], bend; /* of the ball */
} open_ball;

static int is_cut(const open_ball *b, const double p[3]) {
  for (int i = 0; i < b->caps; i++) {
    double to[3] = {b->at[i][0], b->at[i][1], b->at[i][2]};
    orb_normalize(to);
    if (orb_dot(p, to) > cos(b->degrees[i] * M_PI / 180)) {
      return 1;
    }
  }
  return 0;
}

/* The shape with its holes filled, and its embedding. */
static void make(const open_ball *b, int levels, orb_mesh *mesh, orb_embedding *embedding) {
  orb_mesh ball = shape_ball(ctx, levels);
  const size_t room = 96 * (size_t)(ball.vertex_count + ball.triangle_count);
  char *text = malloc(room);
  size_t used = 0;
  assert_non_null(text);
  for (int32_t v = 0; v < ball.vertex_count; v++) {
    const double *p = ball.positions + 3 * v;
    used +=
        (size_t)snprintf(text + used, room - used, "v %.17g %.17g %.17g\n", b->scale[0] * p[0] + b->bend * p[1] * p[1],
                         b->scale[1] * p[1], b->scale[2] * p[2] + 0.2 * b->bend * p[0]);
  }
  for (int32_t t = 0; t < ball.triangle_count; t++) {
    const int32_t *c = ball.triangles + 3 * t;
    double middle[3] = {0, 0, 0};
    for (int k = 0; k < 9; k++) {
      middle[k % 3] += ball.positions[3 * c[k / 3] + k % 3];
    }
    orb_normalize(middle);
    if (!is_cut(b, middle)) {
      used += (size_t)snprintf(text + used, room - used, "f %d %d %d\n", c[0] + 1, c[1] + 1, c[2] + 1);
    }
  }
  shape_free(ctx, &ball);
  orb_embed_options options;
  orb_embed_defaults(&options);
  assert_int_equal(orb_mesh_read(ctx, (const unsigned char *)text, used, ORB_FORMAT_OBJ, mesh, NULL), ORB_OK);
  assert_int_equal(orb_mesh_repair(ctx, mesh, ORB_REPAIR_FILL_HOLES), ORB_OK);
  assert_int_equal(orb_embed(ctx, mesh, &options, embedding), ORB_OK);
  free(text);
}

static double from_edge(const double p[3], const double a[3], const double b[3]) {
  double edge[3], to[3], off[3];
  orb_sub(b, a, edge);
  orb_sub(p, a, to);
  const double length2 = orb_dot(edge, edge), t = length2 > 0 ? fmin(fmax(orb_dot(to, edge) / length2, 0), 1) : 0;
  for (int k = 0; k < 3; k++) {
    off[k] = to[k] - t * edge[k];
  }
  return orb_length(off);
}

static double from_rims(const orb_mesh *mesh, const int32_t *twin, const double p[3]) {
  double least = INFINITY;
  for (int32_t h = 0; h < 3 * mesh->triangle_count; h++) {
    if (mesh->source_triangle[h / 3] == ORB_MADE_FILL && mesh->source_triangle[twin[h] / 3] != ORB_MADE_FILL) {
      least = fmin(least, from_edge(p, mesh->positions + 3 * mesh->triangles[h],
                                    mesh->positions + 3 * mesh->triangles[orb_next(h)]));
    }
  }
  return least;
}

/* The share of the rim vertices of `from` that the map takes to a rim of `to`. */
static double share_on_rims(const orb_aligned_shape *from, const orb_aligned_shape *to) {
  const orb_mesh *a = &from->mesh, *b = &to->mesh;
  int32_t *twin[2] = {malloc(3 * sizeof(int32_t) * (size_t)a->triangle_count),
                      malloc(3 * sizeof(int32_t) * (size_t)b->triangle_count)};
  orb_locator *locator;
  orb_extent extent;
  int on = 0, all = 0;
  orb_mesh_extent(b, &extent);
  assert_int_equal(orb_mesh_twins(ctx, a->triangles, a->triangle_count, a->vertex_count, twin[0]), ORB_OK);
  assert_int_equal(orb_mesh_twins(ctx, b->triangles, b->triangle_count, b->vertex_count, twin[1]), ORB_OK);
  assert_int_equal(
      orb_locator_create(ctx, to->points, b->vertex_count, b->triangles, b->triangle_count, twin[1], &locator), ORB_OK);
  for (int32_t h = 0; h < 3 * a->triangle_count; h++) {
    if (a->source_triangle[h / 3] == ORB_MADE_FILL && a->source_triangle[twin[0][h] / 3] != ORB_MADE_FILL) {
      orb_place place;
      double p[3];
      orb_locate(locator, from->points + 3 * a->triangles[h], -1, &place);
      orb_place_position(b, &place, p);
      on += from_rims(b, twin[1], p) <= NEAR * extent.diagonal;
      all++;
    }
  }
  orb_locator_destroy(ctx, locator);
  free(twin[0]);
  free(twin[1]);
  return (double)on / all;
}

static void align_pair(const orb_mesh mesh[2], const orb_embedding embedding[2], orb_alignment *out) {
  const orb_align_shape shapes[2] = {{&mesh[0], embedding[0].points}, {&mesh[1], embedding[1].points}};
  orb_align_options options;
  orb_align_defaults(&options);
  options.method = ORB_ALIGN_AUTO;
  options.preset = ORB_PRESET_DEFAULT;
  align_and_check(ctx, shapes, 2, NULL, 0, &options, out);
}

/* Aligns two shapes; as many rims as `expected` match, each vertex of the first rims lies on the second ones where no
 * hole is left over, and the found landmarks are on the given meshes. */
static void check_pair(const open_ball *first, const open_ball *second, int expected, double energy, const char *what) {
  orb_mesh mesh[2];
  orb_embedding embedding[2];
  orb_alignment aligned;
  make(first, 4, &mesh[0], &embedding[0]);
  make(second, 4, &mesh[1], &embedding[1]);
  align_pair(mesh, embedding, &aligned);
  const double share = share_on_rims(&aligned.shapes[0], &aligned.shapes[1]);
  print_message("%s: %d rims, %.3f of the rim vertices, energy %.3f\n", what, aligned.rim_count, share, aligned.energy);
  assert_int_equal(aligned.rim_count, expected);
  assert_true(expected < first->caps || share > 0.99);
  assert_true(aligned.energy < energy);
  for (int32_t i = 0; i < aligned.rim_count; i++) {
    assert_int_equal(aligned.rims[i].shape, 1);
    assert_true(aligned.rims[i].off_relative <= NEAR);
  }
  assert_int_equal(aligned.landmark_count, 0);
  for (int32_t i = 0; i < aligned.found_count * 2; i++) {
    assert_true(aligned.found[i].triangle < mesh[i % 2].triangle_count);
  }
  orb_alignment_free(ctx, &aligned);
  for (int s = 0; s < 2; s++) {
    orb_embedding_free(ctx, &embedding[s]);
    orb_mesh_free(ctx, &mesh[s]);
  }
}

static const open_ball BUSTS[2] = {{1, {{0, -1, 0}}, {35}, {1, 1.3, 0.8}, 0},
                                   {1, {{0.3, -1, 0.3}}, {50}, {1, 1.3, 0.8}, 0.3}};
static const open_ball TUBES[2] = {{2, {{0, 1, 0}, {0, -1, 0}}, {25, 30}, {0.7, 2.5, 0.6}, 0.1},
                                   {2, {{0, 1, 0}, {0, -1, 0}}, {31, 30}, {0.8, 2.5, 0.6}, 0.2}};
static const open_ball MASKS[2] = {
    {4, {{0, 0, -1}, {-0.4, 0.3, 1}, {0.4, 0.35, 1}, {0, -0.5, 1}}, {72, 11, 12, 12}, {1, 1.3, 0.8}, 0.1},
    {4, {{0, 0, -1}, {-0.4, 0.3, 1}, {0.4, 0.45, 1}, {0, -0.5, 1}}, {56, 13, 12, 16}, {1, 1.3, 0.8}, 0.3}};

static void test_busts(void **state) {
  (void)state;
  check_pair(&BUSTS[0], &BUSTS[1], 1, 1.5, "busts");
  if (!IS_SLOW) {
    check_pair(&BUSTS[1], &BUSTS[0], 1, 1.5, "busts, the other way");
  }
}

static void test_tubes(void **state) {
  (void)state;
  check_pair(&TUBES[0], &TUBES[1], 2, 1.5, "tubes");
}

static void test_masks(void **state) {
  (void)state;
  check_pair(&MASKS[0], &MASKS[1], 4, 1.5, "masks");
}

/* A mask without a mouth has no counterpart of the mouth. */
static void test_left_over(void **state) {
  (void)state;
  open_ball mute = MASKS[1];
  mute.caps = 3;
  check_pair(&MASKS[0], &mute, 3, 1.5, "mask and mask without a mouth");
  if (!IS_SLOW) {
    check_pair(&mute, &MASKS[0], 3, 1.5, "the other way");
  }
}

/* Nothing is matched where only one shape has holes. */
static void test_one_open(void **state) {
  (void)state;
  open_ball whole = BUSTS[1];
  whole.caps = 0;
  check_pair(&BUSTS[0], &whole, 0, 1.5, "bust and whole ball");
}

static void test_holes(void **state) {
  (void)state;
  orb_mesh mesh;
  orb_embedding embedding;
  orb_hole_list holes;
  make(&MASKS[0], 4, &mesh, &embedding);
  assert_int_equal(orb_holes_find(ctx, &mesh, &holes), ORB_OK);
  assert_int_equal(holes.count, 4);
  for (int32_t i = 0; i < holes.count; i++) {
    const orb_hole *hole = &holes.of[i];
    double length = 0;
    assert_true(hole->is_simple && hole->count >= 3 && hole->edges == hole->count);
    for (int32_t k = 0; k < hole->count; k++) {
      const int32_t h = holes.half_edges[hole->start + k], g = holes.half_edges[hole->start + (k + 1) % hole->count];
      const int32_t v = mesh.triangles[h], w = mesh.triangles[orb_next(h)];
      assert_int_equal(mesh.source_triangle[h / 3], ORB_MADE_FILL);
      assert_int_equal(mesh.triangles[g], w);
      assert_true(fabs(holes.at[hole->start + k] - length) < 1e-12);
      length += sqrt(orb_distance2(mesh.positions + 3 * v, mesh.positions + 3 * w));
    }
    assert_true(fabs(hole->length - length) < 1e-12);
  }
  orb_holes_free(ctx, &holes);
  orb_embedding_free(ctx, &embedding);
  orb_mesh_free(ctx, &mesh);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_holes),     cmocka_unit_test(test_busts),
                                     cmocka_unit_test(test_tubes),     cmocka_unit_test(test_masks),
                                     cmocka_unit_test(test_left_over), cmocka_unit_test(test_one_open)};
  return cmocka_run_group_tests(tests, context_two_threads, context_end);
}
