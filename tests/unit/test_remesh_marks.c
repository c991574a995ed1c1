/* The marks of rings follow every collapse and fill, and those of surroundings are the sums over two rings. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "remesh/placed/marks.h"
#include "sphere/net.h"
#include "support_remesh.h"

enum { RING = 700 }; /* more than the net has vertices */

typedef struct bench {
  orb_context *ctx;
  orb_aligned_shape shape;
  orb_net net;
  uint64_t *ring;
} bench;

static void set_up(bench *b) {
  b->ctx = remesh_context(2);
  sphere_shape(b->ctx, SPHERE_ICO, 3, 0.2, 3, &b->shape);
  const orb_mesh *mesh = &b->shape.mesh;
  assert_int_equal(orb_net_init(b->ctx, &b->net, b->shape.points, mesh->vertex_count, mesh->triangles,
                                mesh->triangle_count, NULL, mesh->vertex_count),
                   ORB_OK);
  b->ring = calloc((size_t)mesh->vertex_count, sizeof *b->ring);
  orb_marks_of_rings(b->ctx, &b->net, b->ring);
}

static void tear_down(bench *b) {
  free(b->ring);
  orb_net_free(b->ctx, &b->net);
  sphere_shape_free(b->ctx, &b->shape);
  orb_context_destroy(b->ctx);
}

static int neighbours_of(const orb_net *net, int32_t u, int32_t neighbour[RING]) {
  int n = 0;
  int32_t first = net->out[u], h = first;
  do {
    assert_true(n < RING);
    neighbour[n++] = net->triangles[orb_next(h)];
    h = net->twin[orb_prev(h)];
  } while (h != first);
  return n;
}

/* Each vertex, its neighbours, and theirs, one after the other. */
static void assert_right(const bench *b) {
  for (int32_t v = 0; v < b->net.vertex_count; v++) {
    int32_t near[RING], far[RING];
    uint64_t own = 0, both = 0;
    const int n = b->net.out[v] < 0 ? 0 : neighbours_of(&b->net, v, near);
    for (int i = 0; i < n; i++) {
      const uint64_t mark = orb_mark_of_point(orb_net_point(&b->net, near[i]));
      own += mark;
      both += 3 * mark;
      const int m = neighbours_of(&b->net, near[i], far);
      for (int k = 0; k < m; k++) {
        both += orb_mark_of_point(orb_net_point(&b->net, far[k]));
      }
    }
    if (n > 0) {
      assert_true(b->ring[v] == own);
      assert_true(orb_mark_of_surroundings(&b->net, b->ring, v) == both);
    }
  }
}

static void they_are_those_of_a_new_net(void **state) {
  bench b;
  (void)state;
  set_up(&b);
  assert_right(&b);
  tear_down(&b);
}

/* Number `u` of them, or the one with the most neighbours. */
static int choose(const bench *b, int32_t u, const int32_t *neighbour, int n, int hub) {
  int best = u % n, most = 0;
  int32_t far[RING];
  for (int i = 0; hub && i < n; i++) {
    const int m = neighbours_of(&b->net, neighbour[i], far);
    best = m > most ? i : best;
    most = m > most ? m : most;
  }
  return best;
}

/* Collapses what can be. Returns how many. */
static int collapse_all(bench *b, int hub) {
  int32_t neighbour[RING];
  int done = 0;
  for (int32_t u = 0; u < b->net.vertex_count; u++) {
    const int n = b->net.out[u] < 0 ? 0 : neighbours_of(&b->net, u, neighbour);
    const int at = n > 0 ? choose(b, u, neighbour, n, hub) : 0;
    const int32_t h = n > 3 && n < RING / 20 ? orb_net_edge(&b->net, u, neighbour[at]) : -1;
    if (h >= 0 && orb_net_can_collapse(&b->net, h)) {
      orb_marks_collapse(&b->net, b->ring, u, neighbour, n, at);
      orb_net_collapse(&b->net, h);
      assert_right(b);
      done++;
    }
  }
  return done;
}

static void they_follow_collapses(void **state) {
  bench b;
  (void)state;
  set_up(&b);
  assert_true(collapse_all(&b, 0) > b.net.vertex_count / 4);
  tear_down(&b);
}

static void they_follow_collapses_onto_hubs(void **state) {
  bench b;
  int32_t neighbour[RING];
  int most = 0;
  (void)state;
  set_up(&b);
  while (collapse_all(&b, 1) > 0) {
  }
  for (int32_t v = 0; v < b.net.vertex_count; v++) {
    const int n = b.net.out[v] < 0 ? 0 : neighbours_of(&b.net, v, neighbour);
    most = n > most ? n : most;
  }
  assert_true(most > 48); /* a vertex that no collapse may move */
  tear_down(&b);
}

/* Fills the hole by a fan, unless an edge of the fan is there already. */
static int fill(bench *b, int32_t u) {
  int32_t neighbour[RING];
  int triangles[ORB_FILL_MOST][3];
  const int n = neighbours_of(&b->net, u, neighbour);
  if (n < 3 || n > ORB_FILL_MOST) {
    return 0;
  }
  for (int i = 2; i + 1 < n; i++) {
    if (orb_net_adjacent(&b->net, neighbour[0], neighbour[i])) {
      return 0;
    }
  }
  for (int t = 0; t < n - 2; t++) {
    triangles[t][0] = 0;
    triangles[t][1] = t + 1;
    triangles[t][2] = t + 2;
  }
  orb_marks_fill(&b->net, b->ring, u, neighbour, n, triangles);
  orb_net_fill(&b->net, b->net.out[u], n, triangles);
  return 1;
}

static void they_follow_fills(void **state) {
  bench b;
  int done = 0;
  (void)state;
  set_up(&b);
  for (int32_t u = 0; u < b.net.vertex_count && done < 60; u++) {
    if (fill(&b, u)) {
      assert_right(&b);
      done++;
    }
  }
  assert_int_equal(done, 60);
  tear_down(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(they_are_those_of_a_new_net), cmocka_unit_test(they_follow_collapses),
      cmocka_unit_test(they_follow_collapses_onto_hubs), cmocka_unit_test(they_follow_fills)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
