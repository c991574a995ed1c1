/* The steps of the adaptive method one by one: none leaves the limit, whatever the map does. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "numeric/vec3.h"
#include "remesh/adaptive/match.h"
#include "remesh/distance.h"
#include "remesh/net_export.h"
#include "support_remesh.h"

typedef struct bench {
  orb_context *ctx;
  orb_aligned_shape shape[2];
  int32_t *twin[2];
  orb_locator *locator[2];
  double diagonal[2];
  orb_remesh_options options;
  orb_remesh_job job;
  orb_match match;
} bench;

static const double LIMIT = 0.01;

/* Turns a ball about an axis in space, the more the farther along it, and leaves the sphere's points. */
static void shear(const orb_aligned_shape *shape, int axis, double most) {
  int x = (axis + 1) % 3, y = (axis + 2) % 3;
  for (int32_t v = 0; v < shape->mesh.vertex_count; v++) {
    double *p = shape->mesh.positions + 3 * v, turn = most * p[axis] / sqrt(orb_dot(p, p));
    double px = p[x], py = p[y];
    p[x] = cos(turn) * px - sin(turn) * py;
    p[y] = sin(turn) * px + cos(turn) * py;
  }
}

/* Two rough balls of so many divisions; the second wound up, so that large triangles turn in space. */
static void set_up_in(bench *b, orb_context *ctx, int size, unsigned seed, double wind) {
  memset(b, 0, sizeof *b);
  b->ctx = ctx;
  sphere_shape(b->ctx, SPHERE_ICO, size, 0.2, seed, &b->shape[0]);
  sphere_shape(b->ctx, SPHERE_OCTA, size, 0.2, seed + 10, &b->shape[1]);
  shear(&b->shape[1], 2, wind);
  shear(&b->shape[1], 0, wind);
  unsigned random = seed;
  for (int s = 0; s < 2; s++) {
    orb_mesh *mesh = &b->shape[s].mesh;
    for (int32_t i = 0; i < 3 * mesh->vertex_count; i += 3) {
      random = random * 1664525u + 1013904223u;
      for (int k = 0; k < 3; k++) {
        mesh->positions[i + k] *= 0.85 + 0.3 * (random >> 16) / 65536.0;
      }
    }
    b->twin[s] = malloc(3 * (size_t)mesh->triangle_count * sizeof(int32_t));
    assert_int_equal(orb_mesh_twins(b->ctx, mesh->triangles, mesh->triangle_count, mesh->vertex_count, b->twin[s]),
                     ORB_OK);
    assert_int_equal(orb_locator_create(b->ctx, b->shape[s].points, mesh->vertex_count, mesh->triangles,
                                        mesh->triangle_count, b->twin[s], &b->locator[s]),
                     ORB_OK);
    b->diagonal[s] = sphere_diagonal(&b->shape[s]);
  }
  orb_remesh_defaults(&b->options);
  b->job = (orb_remesh_job){.shapes = b->shape,
                            .shape_count = 2,
                            .options = &b->options,
                            .twin = b->twin,
                            .locator = b->locator,
                            .diagonal = b->diagonal};
  assert_int_equal(orb_match_create(b->ctx, &b->job, &b->match), ORB_OK);
}

static void set_up(bench *b, unsigned seed, double wind) {
  set_up_in(b, remesh_context(2), 3, seed, wind);
}

static void tear_down(bench *b) {
  orb_match_free(b->ctx, &b->match);
  for (int s = 0; s < 2; s++) {
    orb_locator_destroy(b->ctx, b->locator[s]);
    free(b->twin[s]);
    sphere_shape_free(b->ctx, &b->shape[s]);
  }
  orb_context_destroy(b->ctx);
}

static void refine(bench *b) {
  int64_t strays = 1;
  for (int i = 0; i < 32 && strays > 0; i++) {
    assert_int_equal(orb_match_refine(b->ctx, &b->match, LIMIT * LIMIT, &strays), ORB_OK);
  }
  assert_int_equal(strays, 0);
}

static void assert_within(bench *b) {
  double bound[2];
  assert_int_equal(orb_match_bounds(b->ctx, &b->match, bound), ORB_OK);
  for (int s = 0; s < 2; s++) {
    assert_true(bound[s] <= LIMIT * b->diagonal[s] * (1 + 1e-9));
  }
}

/* T = 2V − 4 and every triangle positive, by the certificate; every vertex of a shape in a live triangle or vertex. */
static void assert_sound(bench *b) {
  const orb_match *match = &b->match;
  orb_supermesh out = {.shape_count = 2};
  assert_int_equal(orb_net_export(b->ctx, &match->net, &out, NULL), ORB_OK);
  assert_int_equal(orb_supermesh_check(b->ctx, &out), ORB_OK);
  orb_supermesh_free(b->ctx, &out);
  int64_t items = 0;
  for (int32_t v = 0; v < match->net.vertex_count; v++) {
    for (int32_t i = match->vertex_items[v]; i >= 0; i = match->item_next[i]) {
      assert_true(match->net.out[v] >= 0);
      items++;
    }
  }
  for (int32_t t = 0; t < match->net.triangle_count; t++) {
    for (int32_t i = match->triangle_items[t]; i >= 0; i = match->item_next[i]) {
      assert_true(match->net.triangles[3 * t] >= 0);
      items++;
    }
  }
  assert_int_equal(items, match->item_begin[2]);
}

/* What mends turned triangles leaves no edge and no vertex of a shape beyond the limit. */
static void mending_leaves_no_stray(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= 4; seed++) {
    bench b;
    set_up(&b, seed, 2);
    refine(&b);
    assert_within(&b);
    int64_t before = orb_match_turned(b.ctx, &b.match);
    assert_true(before > 0);
    assert_int_equal(orb_match_mend(b.ctx, &b.match, LIMIT * LIMIT), ORB_OK);
    assert_true(orb_match_turned(b.ctx, &b.match) < before);
    assert_within(&b);
    assert_sound(&b);
    tear_down(&b);
  }
}

/* The overlay of the reduced shapes is smaller than that of the shapes, all of their vertices lie in it, and it needs
 * little to be within the limit. How large the overlay is, is told well enough. */
static void reduced_shapes_give_a_start(void **state) {
  (void)state;
  bench b;
  set_up(&b, 3, 2);
  orb_match_free(b.ctx, &b.match);
  int64_t told, exact, strays;
  assert_int_equal(orb_match_overlay_size(b.ctx, &b.job, &told), ORB_OK);
  assert_int_equal(orb_match_start_from_overlay(b.ctx, &b.job, &b.match), ORB_OK);
  assert_sound(&b);
  exact = orb_match_live(&b.match);
  assert_true(10 * told > 8 * exact && 10 * told < 12 * exact);
  assert_int_equal(orb_match_start_from_reduced(b.ctx, &b.job, LIMIT * LIMIT, &b.match), ORB_OK);
  assert_sound(&b);
  assert_true(orb_match_live(&b.match) < exact);
  assert_int_equal(orb_match_refine(b.ctx, &b.match, LIMIT * LIMIT, &strays), ORB_OK);
  assert_true(strays < orb_match_live(&b.match) / 4);
  refine(&b);
  assert_within(&b);
  assert_sound(&b);
  tear_down(&b);
}

/* One thread and four tell the same size and come to the same start. */
static void starts_do_not_depend_on_threads(void **state) {
  (void)state;
  bench b[2];
  int64_t told[2];
  for (int i = 0; i < 2; i++) {
    set_up_in(&b[i], remesh_context(i ? 4 : 1), 4, 3, 2);
    assert_int_equal(orb_match_overlay_size(b[i].ctx, &b[i].job, &told[i]), ORB_OK);
    assert_int_equal(orb_match_start_from_reduced(b[i].ctx, &b[i].job, LIMIT * LIMIT, &b[i].match), ORB_OK);
  }
  const orb_net *one = &b[0].match.net, *four = &b[1].match.net;
  assert_int_equal(told[0], told[1]);
  assert_int_equal(one->vertex_count, four->vertex_count);
  assert_int_equal(one->triangle_count, four->triangle_count);
  assert_memory_equal(one->points, four->points, 3 * (size_t)one->vertex_count * sizeof(double));
  assert_memory_equal(one->triangles, four->triangles, 3 * (size_t)one->triangle_count * sizeof(int32_t));
  assert_memory_equal(b[0].match.at, b[1].match.at, 6 * (size_t)one->vertex_count * sizeof(double));
  tear_down(&b[0]);
  tear_down(&b[1]);
}

/* Each allocation of a start from reduced shapes fails once: it says so, and leaves nothing behind. */
static void starts_fail_cleanly(void **state) {
  (void)state;
  int64_t left = INT64_MAX;
  bench b;
  set_up_in(&b, remesh_failing_context(&left), 1, 3, 1);
  orb_status status = ORB_E_NO_MEMORY;
  for (int64_t n = 0; status != ORB_OK; n++) {
    assert_true(n < 3000);
    left = n;
    status = orb_match_start_from_reduced(b.ctx, &b.job, LIMIT * LIMIT, &b.match);
    assert_true(status == ORB_OK || status == ORB_E_NO_MEMORY);
    assert_true(n > 20 || status == ORB_E_NO_MEMORY); /* there are many more than that */
  }
  left = INT64_MAX;
  assert_sound(&b);
  tear_down(&b);
}

/* Collapses, merges, turns and moves keep the limit, and turn no triangle. */
static void reducing_keeps_the_limit(void **state) {
  (void)state;
  bench b;
  set_up(&b, 3, 1);
  refine(&b);
  int64_t turned = orb_match_turned(b.ctx, &b.match), live = orb_match_live(&b.match);
  for (int i = 0; i < 2; i++) {
    assert_int_equal(orb_match_collapse(b.ctx, &b.match, LIMIT * LIMIT, 0, 1, i), ORB_OK);
    assert_within(&b);
    int64_t collapsed = orb_match_live(&b.match);
    assert_true(collapsed < live);
    assert_int_equal(orb_match_merge_all(b.ctx, &b.match, LIMIT * LIMIT, 0), ORB_OK);
    live = orb_match_live(&b.match);
    assert_true(live < collapsed);
    assert_within(&b);
    assert_int_equal(orb_match_turn_all(b.ctx, &b.match, LIMIT * LIMIT, 0), ORB_OK);
    assert_within(&b);
    assert_int_equal(orb_match_move_all(b.ctx, &b.match, LIMIT * LIMIT, NULL), ORB_OK);
    assert_within(&b);
    assert_sound(&b);
    assert_true(orb_match_turned(b.ctx, &b.match) <= turned);
    turned = orb_match_turned(b.ctx, &b.match);
  }
  tear_down(&b);
}

/* A triangle budget of merges is kept. */
static void merges_stop_at_the_target(void **state) {
  (void)state;
  bench b;
  set_up(&b, 5, 0);
  refine(&b);
  assert_int_equal(orb_match_collapse(b.ctx, &b.match, LIMIT * LIMIT, 0, 1, 0), ORB_OK);
  int64_t target = orb_match_live(&b.match) - 10;
  assert_int_equal(orb_match_merge_all(b.ctx, &b.match, LIMIT * LIMIT, target), ORB_OK);
  assert_true(orb_match_live(&b.match) <= target && orb_match_live(&b.match) > target - 8);
  tear_down(&b);
}

/* Around turned triangles the overlay is made: nothing strays there, and what the rest needs refinement gives. */
static void resolving_can_be_held(void **state) {
  (void)state;
  bench b;
  set_up(&b, 2, 2);
  refine(&b);
  assert_int_equal(orb_match_collapse(b.ctx, &b.match, LIMIT * LIMIT, 0, 1, 0), ORB_OK);
  int64_t live = orb_match_live(&b.match);
  assert_true(orb_match_turned(b.ctx, &b.match) > 0);
  assert_int_equal(orb_match_resolve(b.ctx, &b.match, LIMIT * LIMIT), ORB_OK);
  assert_true(orb_match_live(&b.match) > live);
  assert_sound(&b);
  refine(&b);
  assert_within(&b);
  assert_sound(&b);
  tear_down(&b);
}

/* Triangles without an inside: their distance is that of their sides, whichever corner is named first. */
static void flat_triangles_are_as_near_as_their_sides(void **state) {
  (void)state;
  unsigned random = 7;
  double x[12];
  for (int i = 0; i < 1000; i++) {
    for (int k = 0; k < 12; k++) {
      random = random * 1664525u + 1013904223u;
      x[k] = (random >> 8) / 16777216.0;
    }
    const double *a = x, *b = x + 3, *p = x + 9;
    double c[3], along = 3 * x[6] - 1, least = INFINITY;
    for (int k = 0; k < 3; k++) {
      c[k] = a[k] + along * (b[k] - a[k]) + (i % 2 ? 1e-10 * x[6 + k] : 0);
    }
    const double *corner[3] = {a, b, c};
    for (int side = 0; side < 3; side++) {
      for (int step = 0; step <= 1000; step++) {
        double q[3];
        for (int k = 0; k < 3; k++) {
          q[k] = corner[side][k] + step / 1000.0 * (corner[(side + 1) % 3][k] - corner[side][k]);
        }
        least = fmin(least, orb_distance2(p, q));
      }
    }
    for (int turn = 0; turn < 3; turn++) {
      double d = orb_point_triangle2(p, corner[turn], corner[(turn + 1) % 3], corner[(turn + 2) % 3]);
      assert_true(d < least + 1e-9 && d > least - 1e-4);
    }
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(mending_leaves_no_stray),         cmocka_unit_test(reduced_shapes_give_a_start),
      cmocka_unit_test(starts_do_not_depend_on_threads), cmocka_unit_test(starts_fail_cleanly),
      cmocka_unit_test(reducing_keeps_the_limit),        cmocka_unit_test(merges_stop_at_the_target),
      cmocka_unit_test(resolving_can_be_held),           cmocka_unit_test(flat_triangles_are_as_near_as_their_sides),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
