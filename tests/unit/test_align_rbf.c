/* The options of the warp: one radius for all landmarks or one for each, passes, steps, and targets at the midpoints or
 * on the first shape, for two and three shapes. Landmarks meet bit for bit, nothing folds, and nothing moves that
 * should not. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "align/rbf/warp.h"
#include "numeric/vec3.h"
#include "orbmorph/align.h"
#include "support_align.h"
#include "support_bodies.h"

enum { COUNT = 14 };

/* Landmarks on a lattice; on later shapes each is at the vertex nearest to a direction `shift` away. */
static void shifted(bodies *b, double shift) {
  bodies_like(b, COUNT);
  for (int s = 1; s < BODIES; s++) {
    for (int k = 0; k < COUNT; k++) {
      const double *from = b->points[s] + 3 * bodies_vertex_at(&b->mesh[s], &b->at[k][s]);
      double goal[3] = {from[0] + shift * sin(2.0 * k + s), from[1] + shift * cos(3.0 * k), from[2]};
      int32_t best = 0;
      orb_normalize(goal);
      for (int32_t v = 0; v < b->mesh[s].vertex_count; v++) {
        int taken = 0;
        for (int j = 0; j < k; j++) {
          taken |= bodies_vertex_at(&b->mesh[s], &b->at[j][s]) == v;
        }
        if (!taken && orb_distance2(b->points[s] + 3 * v, goal) < orb_distance2(b->points[s] + 3 * best, goal)) {
          best = v;
        }
      }
      assert_int_equal(orb_place_of_vertex(b->ctx, &b->mesh[s], best, &b->at[k][s]), ORB_OK);
    }
  }
}

static void every_option_meets(void **state) {
  (void)state;
  static const double radii[] = {0, 0.3, 2.5};
  static const int32_t steps[] = {1, 3, 40};
  bodies b;
  bodies_open(&b, NULL);
  shifted(&b, 0.35);
  for (int i = 0; i < 24; i++) {
    orb_align_options options = bodies_options(ORB_ALIGN_RBF);
    options.rbf_radius = radii[i % 3];
    options.rbf_steps = steps[i / 3 % 3];
    options.one_way = i % 2;
    for (int k = 0; k < COUNT; k++) {
      b.landmark[k].radius = i % 4 == 3 ? 0.2 + 0.1 * k : 0;
      b.landmark[k].pass = i % 5 == 4 ? (k * 7 % 3) * 10 - 10 : 0;
    }
    orb_alignment out;
    align_and_check(b.ctx, b.shape, 2 + i % 2, b.landmark, COUNT, &options, &out);
    orb_alignment_free(b.ctx, &out);
  }
  bodies_close(&b);
}

/* With one_way the first shape stays where it is, bit for bit; otherwise it moves to the midpoints. */
static void one_way_moves_the_later_shapes_only(void **state) {
  (void)state;
  bodies b;
  bodies_open(&b, NULL);
  shifted(&b, 0.25);
  size_t size = 3 * (size_t)b.mesh[0].vertex_count * sizeof(double);
  for (int one_way = 0; one_way < 2; one_way++) {
    orb_align_options options = bodies_options(ORB_ALIGN_RBF);
    orb_alignment out;
    options.one_way = one_way;
    align_and_check(b.ctx, b.shape, BODIES, b.landmark, COUNT, &options, &out);
    assert_int_equal(memcmp(out.shapes[0].points, b.points[0], size) == 0, one_way);
    orb_alignment_free(b.ctx, &out);
  }
  bodies_close(&b);
}

/* All landmarks but one agree already; that one moves by an edge. Returns how far points farther than `beyond` move. */
static double moved_beyond(bodies *b, double beyond, double for_all, double own) {
  orb_align_shape shapes[2] = {b->shape[1], b->shape[1]};
  bodies_like(b, 40);
  for (int k = 0; k < 40; k++) {
    b->at[k][0] = b->at[k][1];
    b->landmark[k].radius = k == 20 ? own : 0;
  }
  int32_t v = bodies_vertex_at(&b->mesh[1], &b->at[20][1]), h = 0;
  while (b->mesh[1].triangles[h] != v) {
    h++;
  }
  assert_int_equal(orb_place_of_vertex(b->ctx, &b->mesh[1], b->mesh[1].triangles[orb_next(h)], &b->at[20][1]), ORB_OK);
  orb_align_options options = bodies_options(ORB_ALIGN_RBF);
  orb_alignment out;
  options.rbf_radius = for_all;
  options.one_way = 1;
  align_and_check(b->ctx, shapes, 2, b->landmark, 40, &options, &out);
  const double *centre = out.shapes[0].points + 3 * v;
  double most = 0;
  for (int32_t u = 0; u < b->mesh[1].vertex_count; u++) {
    if (orb_distance2(b->points[1] + 3 * u, centre) > beyond * beyond) {
      most = fmax(most, sqrt(orb_distance2(out.shapes[1].points + 3 * u, out.shapes[0].points + 3 * u)));
    }
  }
  orb_alignment_free(b->ctx, &out);
  return most;
}

/* With small radii, points beyond the radius of the moving landmark stay, up to the affine part of the warp, which is
 * almost zero when all other landmarks stay. With a large radius, distant points move. */
static void a_radius_bounds_the_influence(void **state) {
  (void)state;
  bodies b;
  bodies_open(&b, NULL);
  double narrow = moved_beyond(&b, 0.5, 0.2, 0), wide = moved_beyond(&b, 0.5, 1.5, 0);
  assert_true(narrow < 0.02);
  assert_true(wide > narrow);
  bodies_close(&b);
}

/* A landmark's own radius overrides the common one: the moving landmark has exactly the reach of its radius, while the
 * others have almost none. */
static void a_landmark_has_a_radius_of_its_own(void **state) {
  (void)state;
  bodies b;
  bodies_open(&b, NULL);
  double narrow = moved_beyond(&b, 0.5, 0.2, 0), same = moved_beyond(&b, 0.5, 0.4, 0.2);
  double wide = moved_beyond(&b, 0.5, 0.2, 1.5), beyond = moved_beyond(&b, 1.5, 0.2, 1.5);
  assert_true(narrow < 0.02 && same < 0.02);
  assert_true(wide > 3 * narrow); /* up to 1.5 away */
  assert_true(beyond < wide / 3); /* and no farther */
  bodies_close(&b);
}

/* Where one step of the first pass moves the landmarks of the second pass: the paper's warp through the other
 * landmarks, from their points after the rotations to their means. */
static void carry(const bodies *b, const orb_alignment *rotated, int s, double (*carried)[3]) {
  double centres[3 * COUNT], moves[3 * COUNT], radii[COUNT];
  int32_t count = 0;
  for (int k = 0; k < COUNT; k++) {
    const double *p[2];
    for (int i = 0; i < 2; i++) {
      p[i] = rotated->shapes[i].points + 3 * rotated->shapes[i].landmark_vertices[k];
    }
    memcpy(carried[k], p[s], 3 * sizeof(double));
    if (b->landmark[k].pass == 0) {
      double mean[3];
      for (int c = 0; c < 3; c++) {
        mean[c] = p[0][c] + p[1][c];
      }
      (void)orb_normalize(mean);
      memcpy(centres + 3 * count, p[s], 3 * sizeof(double));
      orb_sub(mean, p[s], moves + 3 * count);
      radii[count++] = 2;
    }
  }
  orb_warp warp;
  assert_int_equal(orb_warp_create(b->ctx, centres, moves, radii, count, &warp), ORB_OK);
  orb_warp_apply(b->ctx, &warp, carried[0], COUNT, carried[0]);
  orb_warp_free(b->ctx, &warp);
}

/* The second pass starts where the first ends: its landmarks meet halfway between the points to which the first warp
 * moved them, and the landmarks of the first pass stay where they met. */
static void later_passes_begin_where_earlier_ones_end(void **state) {
  (void)state;
  bodies b;
  bodies_open(&b, NULL);
  shifted(&b, 0.08);
  for (int k = 0; k < COUNT; k++) {
    b.landmark[k].pass = k % 7 == 3;
  }
  orb_align_options options = bodies_options(ORB_ALIGN_ROTATE);
  orb_alignment rotated, out;
  assert_int_equal(orb_align(b.ctx, b.shape, 2, b.landmark, COUNT, &options, &rotated), ORB_OK);
  options = bodies_options(ORB_ALIGN_RBF);
  options.rbf_radius = 2;
  options.rbf_steps = 1;
  align_and_check(b.ctx, b.shape, 2, b.landmark, COUNT, &options, &out);
  double carried[2][COUNT][3], unlike = 0;
  carry(&b, &rotated, 0, carried[0]);
  carry(&b, &rotated, 1, carried[1]);
  for (int k = 0; k < COUNT; k++) {
    double wanted[3], simply[3];
    for (int c = 0; c < 3; c++) {
      wanted[c] = carried[0][k][c] + carried[1][k][c];
      simply[c] = 0;
      for (int s = 0; s < 2; s++) {
        simply[c] += rotated.shapes[s].points[3 * rotated.shapes[s].landmark_vertices[k] + c];
      }
    }
    (void)orb_normalize(wanted);
    (void)orb_normalize(simply);
    unlike = fmax(unlike, orb_distance2(wanted, simply));
    assert_true(orb_distance2(out.shapes[0].points + 3 * out.shapes[0].landmark_vertices[k], wanted) < 1e-20);
  }
  assert_true(unlike > 1e-8); /* in one pass they would meet elsewhere */
  orb_alignment_free(b.ctx, &rotated);
  orb_alignment_free(b.ctx, &out);
  bodies_close(&b);
}

/* Crossing landmarks are still met, by the patches of pin. */
static void crossed_landmarks_meet(void **state) {
  (void)state;
  bodies b;
  bodies_open(&b, NULL);
  for (uint64_t seed = 1; seed <= 3; seed++) {
    bodies_random(&b, 10, seed);
    orb_align_options options = bodies_options(ORB_ALIGN_RBF);
    orb_alignment out;
    align_and_check(b.ctx, b.shape, 3, b.landmark, 10, &options, &out);
    orb_alignment_free(b.ctx, &out);
  }
  bodies_close(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(every_option_meets),
      cmocka_unit_test(one_way_moves_the_later_shapes_only),
      cmocka_unit_test(a_radius_bounds_the_influence),
      cmocka_unit_test(a_landmark_has_a_radius_of_its_own),
      cmocka_unit_test(later_passes_begin_where_earlier_ones_end),
      cmocka_unit_test(crossed_landmarks_meet),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
