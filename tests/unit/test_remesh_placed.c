/* The steps of the adaptive method one by one: each stays within the limit, for every map. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "numeric/vec3.h"
#include "remesh/adaptive/collapse.h"
#include "remesh/adaptive/merge.h"
#include "remesh/adaptive/move.h"
#include "remesh/adaptive/repair.h"
#include "remesh/adaptive/resolve.h"
#include "remesh/adaptive/star.h"
#include "remesh/adaptive/start.h"
#include "remesh/common/supermesh.h"
#include "remesh/placed/bound.h"
#include "remesh/placed/distance.h"
#include "remesh/placed/export.h"
#include "remesh/placed/flip.h"
#include "remesh/placed/form.h"
#include "remesh/placed/refine.h"
#include "support_remesh.h"

typedef struct bench {
  orb_context *ctx;
  orb_aligned_shape shape[2];
  int32_t *twin[2];
  orb_locator *locator[2];
  double diagonal[2];
  orb_remesh_options options;
  orb_remesh_job job;
  orb_placed_net placed;
} bench;

static const double LIMIT = 0.01;
static const double WIDE = 0.02; /* for thinning: what it drops beyond the limit, refinement brings back */

/* Twists a ball around an axis in space and keeps its points on the sphere. */
static void shear(const orb_aligned_shape *shape, int axis, double most) {
  int x = (axis + 1) % 3, y = (axis + 2) % 3;
  for (int32_t v = 0; v < shape->mesh.vertex_count; v++) {
    double *p = shape->mesh.positions + 3 * v, angle = most * p[axis] / sqrt(orb_dot(p, p));
    double px = p[x], py = p[y];
    p[x] = cos(angle) * px - sin(angle) * py;
    p[y] = sin(angle) * px + cos(angle) * py;
  }
}

/* Two rough balls; the second is twisted, so that large triangles are inverted. */
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
  assert_int_equal(orb_placed_create(b->ctx, &b->job, &b->placed), ORB_OK);
}

static void set_up(bench *b, unsigned seed, double wind) {
  set_up_in(b, remesh_context(2), 3, seed, wind);
}

static void tear_down(bench *b) {
  orb_placed_free(b->ctx, &b->placed);
  for (int s = 0; s < 2; s++) {
    orb_locator_destroy(b->ctx, b->locator[s]);
    free(b->twin[s]);
    sphere_shape_free(b->ctx, &b->shape[s]);
  }
  orb_context_destroy(b->ctx);
}

static void refine(bench *b) {
  int64_t deviating = 1;
  for (int i = 0; i < 32 && deviating > 0; i++) {
    assert_int_equal(orb_placed_refine(b->ctx, &b->placed, LIMIT * LIMIT, &deviating), ORB_OK);
  }
  assert_int_equal(deviating, 0);
}

static void assert_within(bench *b) {
  double bound[2];
  assert_int_equal(orb_placed_bounds(b->ctx, &b->placed, bound), ORB_OK);
  for (int s = 0; s < 2; s++) {
    assert_true(bound[s] <= LIMIT * b->diagonal[s] * (1 + 1e-9));
  }
}

/* T = 2V − 4 and every triangle positive, by the certificate; every vertex of a shape in a live triangle or vertex. */
static void assert_valid(bench *b) {
  const orb_placed_net *placed = &b->placed;
  orb_supermesh out = {.shape_count = 2};
  assert_int_equal(orb_net_export(b->ctx, &placed->net, &out, NULL), ORB_OK);
  assert_int_equal(orb_supermesh_check(b->ctx, &out), ORB_OK);
  orb_supermesh_free(b->ctx, &out);
  int64_t items = 0;
  for (int32_t v = 0; v < placed->net.vertex_count; v++) {
    for (int32_t i = placed->vertex_items[v]; i >= 0; i = placed->item_next[i]) {
      assert_true(placed->net.out[v] >= 0);
      items++;
    }
  }
  for (int32_t t = 0; t < placed->net.triangle_count; t++) {
    for (int32_t i = placed->triangle_items[t]; i >= 0; i = placed->item_next[i]) {
      assert_true(placed->net.triangles[3 * t] >= 0);
      items++;
    }
  }
  assert_int_equal(items, placed->item_begin[2]);
}

/* The repair of inverted triangles leaves no edge and no vertex of a shape beyond the limit. */
static void repair_keeps_the_limit(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= 4; seed++) {
    bench b;
    set_up(&b, seed, 2);
    refine(&b);
    assert_within(&b);
    int64_t before = orb_placed_count_inverted(b.ctx, &b.placed);
    assert_true(before > 0);
    assert_int_equal(orb_adaptive_repair(b.ctx, &b.placed, LIMIT * LIMIT), ORB_OK);
    assert_true(orb_placed_count_inverted(b.ctx, &b.placed) < before);
    assert_within(&b);
    assert_valid(&b);
    tear_down(&b);
  }
}

/* The overlay of the reduced shapes is smaller than that of the shapes, holds all their vertices, and needs little
 * refinement to be within the limit. The estimate of the overlay's size is within a fifth. */
static void reduced_shapes_give_a_start(void **state) {
  (void)state;
  bench b;
  set_up(&b, 3, 2);
  orb_placed_free(b.ctx, &b.placed);
  int64_t estimate, exact, deviating;
  assert_int_equal(orb_adaptive_overlay_size(b.ctx, &b.job, &estimate), ORB_OK);
  assert_int_equal(orb_adaptive_start_from_overlay(b.ctx, &b.job, 0, &b.placed), ORB_OK);
  assert_valid(&b);
  exact = orb_placed_live(&b.placed);
  assert_true(10 * estimate > 8 * exact && 10 * estimate < 12 * exact);
  assert_int_equal(orb_adaptive_start_from_reduced(b.ctx, &b.job, LIMIT * LIMIT, &b.placed), ORB_OK);
  assert_valid(&b);
  assert_true(orb_placed_live(&b.placed) < exact);
  assert_int_equal(orb_placed_refine(b.ctx, &b.placed, LIMIT * LIMIT, &deviating), ORB_OK);
  assert_true(deviating < orb_placed_live(&b.placed) / 4);
  refine(&b);
  assert_within(&b);
  assert_valid(&b);
  tear_down(&b);
}

/* Thinned shapes and a thinned overlay have fewer vertices, and can be refined to the limit with the landmarks kept. */
static void thinned_shapes_give_a_start(void **state) {
  (void)state;
  for (int overlay = 0; overlay < 2; overlay++) {
    bench b;
    set_up_in(&b, remesh_context(2), 4, 3, 0);
    int32_t landmarks[2] = {5, 17};
    b.job.landmark_count = 2;
    b.shape[0].landmark_vertices = b.shape[1].landmark_vertices = landmarks;
    int64_t all = orb_placed_live(&b.placed);
    orb_placed_free(b.ctx, &b.placed);
    if (overlay) {
      assert_int_equal(orb_adaptive_start_from_overlay(b.ctx, &b.job, 0, &b.placed), ORB_OK);
      all = orb_placed_live(&b.placed);
      assert_int_equal(orb_adaptive_start_from_overlay(b.ctx, &b.job, WIDE * WIDE, &b.placed), ORB_OK);
    } else {
      assert_int_equal(orb_adaptive_start_from_thinned(b.ctx, &b.job, WIDE * WIDE, &b.placed), ORB_OK);
    }
    assert_valid(&b);
    assert_true(orb_placed_live(&b.placed) < all);
    int fixed = 0;
    for (int32_t v = 0; v < b.placed.net.vertex_count; v++) {
      fixed += b.placed.fixed[v];
    }
    assert_int_equal(fixed, 4);
    refine(&b);
    assert_within(&b);
    assert_valid(&b);
    b.shape[0].landmark_vertices = b.shape[1].landmark_vertices = NULL;
    tear_down(&b);
  }
}

/* One thread and four estimate the same size and make the same start. */
static void starts_do_not_depend_on_threads(void **state) {
  (void)state;
  bench b[2];
  int64_t estimate[2];
  for (int i = 0; i < 2; i++) {
    set_up_in(&b[i], remesh_context(i ? 4 : 1), 4, 3, 2);
    assert_int_equal(orb_adaptive_overlay_size(b[i].ctx, &b[i].job, &estimate[i]), ORB_OK);
    assert_int_equal(orb_adaptive_start_from_reduced(b[i].ctx, &b[i].job, LIMIT * LIMIT, &b[i].placed), ORB_OK);
  }
  const orb_net *one = &b[0].placed.net, *four = &b[1].placed.net;
  assert_int_equal(estimate[0], estimate[1]);
  assert_int_equal(one->vertex_count, four->vertex_count);
  assert_int_equal(one->triangle_count, four->triangle_count);
  assert_memory_equal(one->points, four->points, 3 * (size_t)one->vertex_count * sizeof(double));
  assert_memory_equal(one->triangles, four->triangles, 3 * (size_t)one->triangle_count * sizeof(int32_t));
  assert_memory_equal(b[0].placed.at, b[1].placed.at, 6 * (size_t)one->vertex_count * sizeof(double));
  tear_down(&b[0]);
  tear_down(&b[1]);
}

static orb_status start(bench *b, int way) {
  if (way == 0) {
    return orb_adaptive_start_from_reduced(b->ctx, &b->job, LIMIT * LIMIT, &b->placed);
  }
  if (way == 1) {
    return orb_adaptive_start_from_overlay(b->ctx, &b->job, LIMIT * LIMIT, &b->placed);
  }
  orb_placed_free(b->ctx, &b->placed);
  return orb_adaptive_start_from_thinned(b->ctx, &b->job, LIMIT * LIMIT, &b->placed);
}

/* Each allocation of a start fails once: the call reports it and leaks nothing. */
static void start_fails_cleanly(int way) {
  int64_t left = INT64_MAX;
  bench b;
  set_up_in(&b, remesh_failing_context(&left), 1, 3, 1);
  orb_status status = ORB_E_NO_MEMORY;
  for (int64_t n = 0; status != ORB_OK; n++) {
    assert_true(n < 3000);
    left = n;
    status = start(&b, way);
    assert_true(status == ORB_OK || status == ORB_E_NO_MEMORY);
    assert_true(n > 20 || status == ORB_E_NO_MEMORY); /* there are many more allocations */
  }
  left = INT64_MAX;
  assert_valid(&b);
  tear_down(&b);
}

static void starts_fail_cleanly(void **state) {
  (void)state;
  for (int way = 0; way < 3; way++) {
    start_fails_cleanly(way);
  }
}

/* Collapses, merges, flips and moves keep the limit and invert no further triangle. */
static void reducing_keeps_the_limit(void **state) {
  (void)state;
  bench b;
  set_up(&b, 3, 1);
  refine(&b);
  int64_t inverted = orb_placed_count_inverted(b.ctx, &b.placed), live = orb_placed_live(&b.placed);
  for (int i = 0; i < 2; i++) {
    assert_int_equal(orb_adaptive_collapse(b.ctx, &b.placed, LIMIT * LIMIT, 0, 1, i), ORB_OK);
    assert_within(&b);
    int64_t collapsed = orb_placed_live(&b.placed);
    assert_true(collapsed < live);
    assert_int_equal(orb_adaptive_merge_all(b.ctx, &b.placed, LIMIT * LIMIT, 0, 0), ORB_OK);
    live = orb_placed_live(&b.placed);
    assert_true(live < collapsed);
    assert_within(&b);
    assert_int_equal(orb_placed_flip_all(b.ctx, &b.placed, LIMIT * LIMIT, 0), ORB_OK);
    assert_within(&b);
    assert_int_equal(orb_adaptive_move_all(b.ctx, &b.placed, LIMIT * LIMIT, NULL), ORB_OK);
    assert_within(&b);
    assert_valid(&b);
    assert_true(orb_placed_count_inverted(b.ctx, &b.placed) <= inverted);
    inverted = orb_placed_count_inverted(b.ctx, &b.placed);
  }
  tear_down(&b);
}

/* Merges stop at the target number of triangles. */
static void merges_stop_at_the_target(void **state) {
  (void)state;
  bench b;
  set_up(&b, 5, 0);
  refine(&b);
  assert_int_equal(orb_adaptive_collapse(b.ctx, &b.placed, LIMIT * LIMIT, 0, 1, 0), ORB_OK);
  int64_t target = orb_placed_live(&b.placed) - 10;
  assert_int_equal(orb_adaptive_merge_all(b.ctx, &b.placed, LIMIT * LIMIT, target, 0), ORB_OK);
  assert_true(orb_placed_live(&b.placed) <= target && orb_placed_live(&b.placed) > target - 8);
  tear_down(&b);
}

/* Resolving makes the overlay around inverted triangles; refinement then brings everything within the limit. */
static void resolving_can_be_refined(void **state) {
  (void)state;
  bench b;
  set_up(&b, 2, 2);
  refine(&b);
  assert_int_equal(orb_adaptive_collapse(b.ctx, &b.placed, LIMIT * LIMIT, 0, 1, 0), ORB_OK);
  int64_t live = orb_placed_live(&b.placed);
  assert_true(orb_placed_count_inverted(b.ctx, &b.placed) > 0);
  assert_int_equal(orb_adaptive_resolve(b.ctx, &b.placed, LIMIT * LIMIT), ORB_OK);
  assert_true(orb_placed_live(&b.placed) > live);
  assert_valid(&b);
  refine(&b);
  assert_within(&b);
  assert_valid(&b);
  tear_down(&b);
}

/* A degenerate triangle is as far as its sides, whichever corner comes first. */
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
    for (int first = 0; first < 3; first++) {
      double d = orb_point_triangle2(p, corner[first], corner[(first + 1) % 3], corner[(first + 2) % 3]);
      assert_true(d < least + 1e-9 && d > least - 1e-4);
    }
  }
}

/* The quick walk along an edge gives the answer of the exact one. */
static void edges_are_within_as_traced(void **state) {
  (void)state;
  static const double limit[] = {1e-4, 1e-3, 1e-2, 1e-1};
  int within[2] = {0, 0};
  for (unsigned seed = 1; seed <= 4; seed++) {
    bench b;
    set_up(&b, seed, seed % 2 ? 0 : 2);
    const orb_net *net = &b.placed.net;
    for (int32_t h = 0; h < 3 * net->triangle_count; h++) {
      /* the edge, and the diagonal across it, which starts in faces, at vertices and on edges of the shapes */
      int32_t ends[2][2] = {{net->triangles[h], net->triangles[net->twin[h]]},
                            {net->triangles[orb_prev(h)], net->triangles[orb_prev(net->twin[h])]}};
      for (int i = 0; i < 8; i++) {
        int32_t v = ends[i / 4][0], w = ends[i / 4][1];
        double limit2 = limit[i % 4] * limit[i % 4];
        int is_within = orb_placed_edge_is_within(&b.placed, v, w, limit2);
        assert_int_equal(is_within, orb_placed_edge2(&b.placed, v, w, INFINITY, NULL) <= limit2);
        within[is_within]++;
      }
    }
    tear_down(&b);
  }
  assert_true(within[0] > 1000 && within[1] > 1000);
}

/* The quick walk to a vertex finds what the locator finds, from any triangle. */
static void vertices_are_located_from_anywhere(void **state) {
  (void)state;
  bench b;
  set_up(&b, 1, 2);
  unsigned random = 1;
  for (int32_t v = 0; v < b.placed.net.vertex_count; v++) {
    for (int32_t s = 0; s < 2; s++) {
      orb_place place;
      orb_locate(b.locator[s], orb_net_point(&b.placed.net, v), -1, &place);
      random = random * 1664525u + 1013904223u;
      orb_placed_locate(&b.placed, v, s, (int32_t)((random >> 8) % (unsigned)b.shape[s].mesh.triangle_count));
      assert_int_equal(b.placed.spot[2 * v + s].h / 3, place.triangle);
      for (int k = 0; k < 3; k++) {
        double at = 0;
        for (int i = 0; i < 3; i++) {
          int32_t corner = b.shape[s].mesh.triangles[3 * place.triangle + i];
          at += place.at[i] * b.shape[s].mesh.positions[3 * corner + k] / b.diagonal[s];
        }
        assert_true(fabs(orb_placed_position(&b.placed, v, s)[k] - at) <= 1e-14);
      }
    }
  }
  tear_down(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(repair_keeps_the_limit),
      cmocka_unit_test(reduced_shapes_give_a_start),
      cmocka_unit_test(starts_do_not_depend_on_threads),
      cmocka_unit_test(starts_fail_cleanly),
      cmocka_unit_test(reducing_keeps_the_limit),
      cmocka_unit_test(merges_stop_at_the_target),
      cmocka_unit_test(thinned_shapes_give_a_start),
      cmocka_unit_test(resolving_can_be_refined),
      cmocka_unit_test(flat_triangles_are_as_near_as_their_sides),
      cmocka_unit_test(edges_are_within_as_traced),
      cmocka_unit_test(vertices_are_located_from_anywhere),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
