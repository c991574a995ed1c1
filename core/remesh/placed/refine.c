/* Edges that deviate are flipped where the other diagonal is within the limit, else split where they deviate most, at
 * the crossing itself. Items that deviate become vertices. */
#include "remesh/placed/refine.h"

#include <math.h>

#include "base/check.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"
#include "remesh/placed/bound.h"
#include "remesh/placed/edge_queue.h"
#include "remesh/placed/flip.h"
#include "remesh/placed/form.h"
#include "remesh/placed/marks.h"

/* A triangle with a height below this share of its longest edge is a needle. */
static const double NEEDLE = 1e-3;
/* Splits keep this share of the edge's length from its ends: closer ones would leave short edges, farther ones would
 * miss the deviation. */
static const double MARGIN = 0.1;
/* The most needles that a split follows, so that it ends where they lie in a ring. */
enum { LONGER_MOST = 64 };
/* Edges of the queue whose deviations are computed at once: more keep the threads busy, but more are computed in vain.
 */
enum { AHEAD = 1024 };
/* Refinement gives up after examining each edge of the start, or of a net of all vertices, four times, and this many
 * more, which lets tiny nets grow. */
enum { EDGES_FREE = 20000 };

/* Flips the edge, whatever that does to the form, if all triangles stay positive on the sphere. */
static int force_flip(orb_placed_net *placed, int32_t h) {
  const orb_net *net = &placed->net;
  int32_t g = net->twin[h], a = net->triangles[h], b = net->triangles[g];
  int32_t c = net->triangles[orb_prev(h)], d = net->triangles[orb_prev(g)];
  const double *p = orb_net_point(net, a), *q = orb_net_point(net, b);
  const double *r = orb_net_point(net, c), *s = orb_net_point(net, d);
  if (orb_placed_keeps(placed, h) || c == d || orb_net_adjacent(net, c, d) || orb_orient(r, s, q) <= 0 ||
      orb_orient(s, r, p) <= 0) {
    return 0;
  }
  orb_placed_flip(placed, h);
  return 1;
}

/* The forms of the two triangles on either side of edge a b, and of those on either side of c d instead. */
static void forms_of_flip(const orb_placed_net *placed, int32_t a, int32_t b, int32_t c, int32_t d, orb_form *before,
                          orb_form *after) {
  *before = orb_form_join(orb_placed_form(placed, a, b, c), orb_placed_form(placed, b, a, d));
  *after = orb_form_join(orb_placed_form(placed, c, d, b), orb_placed_form(placed, d, c, a));
}

/* Flips the edge if the other diagonal is within the limit and the forms allow it. */
static int repair_by_flip(orb_placed_net *placed, int32_t h, double limit2) {
  const orb_net *net = &placed->net;
  int32_t g = net->twin[h], v = net->triangles[h], w = net->triangles[g];
  int32_t c = net->triangles[orb_prev(h)], d = net->triangles[orb_prev(g)];
  orb_form before, after;
  forms_of_flip(placed, v, w, c, d, &before, &after);
  if (orb_placed_keeps(placed, h) || !orb_net_can_flip(net, h) || !orb_form_allows(before, after) ||
      !orb_placed_edge_is_within(placed, c, d, limit2) || orb_placed_flip_items2(placed, h) > limit2) {
    return 0;
  }
  orb_placed_flip(placed, h);
  return 1;
}

/* The longest edge of the triangle of h if the triangle is a needle (height below a thousandth of that edge) and the
 * edge is not h; else −1. */
static int32_t longest_of_needle(const orb_net *net, int32_t h) {
  const double *p[3];
  double length2[3];
  int32_t edge[3] = {h, orb_next(h), orb_prev(h)};
  int longest = 0;
  for (int k = 0; k < 3; k++) {
    p[k] = orb_net_point(net, net->triangles[edge[k]]);
  }
  for (int k = 0; k < 3; k++) {
    length2[k] = orb_distance2(p[k], p[(k + 1) % 3]);
    longest = length2[k] > length2[longest] ? k : longest;
  }
  return longest > 0 && orb_det(p[0], p[1], p[2]) < NEEDLE * length2[longest] ? edge[longest] : -1;
}

/* Splits edge h at the foot of p, but away from its ends. */
static int32_t split_near(orb_placed_net *placed, int32_t h, const double p[3]) {
  const double *a = orb_net_point(&placed->net, placed->net.triangles[h]);
  const double *b = orb_net_point(&placed->net, placed->net.triangles[orb_next(h)]);
  double ab[3], ap[3], x[3];
  orb_sub(b, a, ab);
  orb_sub(p, a, ap);
  double t = fmin(1 - MARGIN, fmax(MARGIN, orb_dot(ab, ap) / orb_dot(ab, ab)));
  for (int k = 0; k < 3; k++) {
    x[k] = a[k] + t * ab[k];
  }
  (void)orb_normalize(x);
  return orb_placed_split(placed, h, x);
}

/* Splits edge h where it deviates most, or instead the longest edge of a needle beside it, and so on from needle to
 * needle: otherwise splits creep towards that edge in ever thinner triangles. Compare Rivara's longest-edge bisection.
 */
static int32_t split_at(orb_placed_net *placed, int32_t h, const orb_deviation *worst) {
  const orb_net *net = &placed->net;
  double p[3];
  orb_placed_crossing_point(placed, net->triangles[h], net->triangles[net->twin[h]], worst, p);
  int32_t split = h;
  for (int step = 0; step < LONGER_MOST; step++) {
    int32_t longer = longest_of_needle(net, split);
    if (longer < 0) {
      longer = longest_of_needle(net, net->twin[split]);
    }
    if (longer < 0) {
      break;
    }
    split = longer;
  }
  int32_t n = split == h ? orb_placed_split(placed, h, p) : split_near(placed, split, p);
  return n >= 0 ? n : split_near(placed, h, p);
}

/* For an edge between needles so thin that no rounded point lies within it: inserts the crossing wherever it lies, and
 * flips the edge, so that edges outside the needles take its place. */
static orb_status give_room(orb_context *ctx, orb_placed_net *placed, int32_t h, const orb_deviation *worst,
                            orb_edge_queue *queue) {
  const orb_net *net = &placed->net;
  int32_t v = net->triangles[h], w = net->triangles[net->twin[h]], before = net->vertex_count;
  double p[3];
  orb_placed_crossing_point(placed, v, w, worst, p);
  int32_t n = orb_placed_insert(placed, h / 3, p);
  if (n >= before) {
    ORB_TRY(orb_edge_queue_push_star(ctx, queue, net, n));
  }
  h = orb_net_edge(net, v, w);
  if (h < 0 || !force_flip(placed, h)) {
    return ORB_OK;
  }
  return orb_edge_queue_push(ctx, queue, net->triangles[h], net->triangles[net->twin[h]]);
}

/* ahead: where the edge deviates most; its shape is −1 where that is not known yet. */
static orb_status repair_edge(orb_context *ctx, orb_placed_net *placed, int32_t v, int32_t w, double limit2,
                              orb_deviation ahead, orb_edge_queue *queue) {
  int32_t h = orb_net_edge(&placed->net, v, w);
  if (h >= 0 && ahead.shape < 0) {
    (void)orb_placed_edge2(placed, v, w, INFINITY, &ahead);
  }
  if (h < 0 || ahead.distance2 <= limit2 || repair_by_flip(placed, h, limit2)) {
    return ORB_OK;
  }
  ORB_TRY(orb_placed_reserve(ctx, placed, 1));
  int32_t n = split_at(placed, h, &ahead);
  if (n < 0) {
    return give_room(ctx, placed, h, &ahead, queue);
  }
  ORB_TRY(orb_edge_queue_push_star(ctx, queue, &placed->net, n));
  return orb_edge_queue_push(ctx, queue, v, w); /* it is still there if another edge was split */
}

typedef struct deviation_loop {
  orb_placed_net *placed;
  double limit2;
  unsigned char *deviating; /* per half-edge */
} deviation_loop;

/* The mark of an edge and the limit within which it was proved to stay. */
static uint64_t mark_of_edge(const orb_placed_net *placed, int32_t v, int32_t w, double limit2) {
  uint64_t mark = orb_mark_mix(1, &limit2, sizeof limit2);
  mark = orb_mark_mix(mark, orb_net_point(&placed->net, v), 3 * sizeof(double));
  mark = orb_mark_mix(mark, orb_net_point(&placed->net, w), 3 * sizeof(double));
  return mark ? mark : 1;
}

static void deviation_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  deviation_loop *loop = arg;
  orb_placed_net *placed = loop->placed;
  const orb_net *net = &placed->net;
  for (int64_t h = begin; h < end; h++) {
    loop->deviating[h] = 0;
    if (net->triangles[h - h % 3] < 0 || h > net->twin[h]) {
      continue;
    }
    int32_t v = net->triangles[h], w = net->triangles[net->twin[h]];
    uint64_t mark = mark_of_edge(placed, v, w, loop->limit2);
    if (placed->within[h] != mark) {
      loop->deviating[h] = !orb_placed_edge_is_within(placed, v, w, loop->limit2);
      placed->within[h] = loop->deviating[h] ? 0 : mark;
    }
  }
}

/* Deviations of the next AHEAD edges of the queue, found in parallel. They stay valid because vertices do not move. */
typedef struct ahead_loop {
  const orb_placed_net *placed;
  const int32_t (*ends)[2];
  orb_deviation *worst;
} ahead_loop;

static void ahead_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  ahead_loop *loop = arg;
  for (int64_t i = begin; i < end; i++) {
    int32_t v = loop->ends[i][0], w = loop->ends[i][1];
    loop->worst[i] = ORB_NO_DEVIATION;
    if (orb_net_edge(&loop->placed->net, v, w) >= 0) {
      (void)orb_placed_edge2(loop->placed, v, w, INFINITY, &loop->worst[i]);
    }
  }
}

/* First in, first out: an old long edge is split before the edges that its neighbours' splits have made, which would
 * otherwise creep towards it in ever thinner triangles. */
static orb_status repair_edges(orb_context *ctx, orb_placed_net *placed, double limit2, int64_t limit,
                               orb_edge_queue *queue) {
  orb_deviation *worst = ORB_NEW(ctx, orb_deviation, AHEAD);
  orb_status status = worst ? ORB_OK : ORB_E_NO_MEMORY;
  for (int64_t i = 0; i < queue->count && i < limit && status == ORB_OK;) {
    int64_t count = queue->count - i < AHEAD ? queue->count - i : AHEAD;
    ahead_loop loop = {placed, (const int32_t(*)[2])queue->ends + i, worst};
    orb_parallel_for(ctx, count, 32, ahead_range, &loop);
    status = orb_context_check(ctx);
    for (int64_t k = 0; k < count && i < limit && status == ORB_OK; k++, i++) {
      status = repair_edge(ctx, placed, queue->ends[i][0], queue->ends[i][1], limit2, worst[k], queue);
    }
  }
  orb_free(ctx, worst);
  return status;
}

/* The item of triangle t that is farthest from it, if it is beyond the limit; else −1. */
static int32_t farthest_item(const orb_placed_net *placed, int32_t t, double limit2) {
  const int32_t *c = placed->net.triangles + 3 * (int64_t)t;
  int32_t farthest = -1;
  for (int32_t i = placed->triangle_items[t]; i >= 0; i = placed->item_next[i]) {
    double distance2 = orb_placed_item2(placed, i, c[0], c[1], c[2]);
    if (distance2 > limit2) {
      limit2 = distance2;
      farthest = i;
    }
  }
  return farthest;
}

/* Inserts the items that lie too far from their triangles, the farthest of each triangle first. */
static orb_status take_items_in(orb_context *ctx, orb_placed_net *placed, double limit2, orb_edge_queue *queue) {
  for (int32_t t = 0; t < placed->net.triangle_count; t++) { /* new triangles are appended and examined too */
    int32_t item = placed->net.triangles[3 * (int64_t)t] < 0 ? -1 : farthest_item(placed, t, limit2);
    if (item < 0) {
      continue;
    }
    ORB_TRY(orb_placed_reserve(ctx, placed, 1));
    int32_t n = orb_placed_insert(placed, t, orb_placed_item_point(placed, item));
    ORB_TRY(orb_edge_queue_push_star(ctx, queue, &placed->net, n));
    t -= farthest_item(placed, t, limit2) >= 0; /* again: others may lie too far from what is left of it */
  }
  return ORB_OK;
}

orb_status orb_placed_refine(orb_context *ctx, orb_placed_net *placed, double limit2, int64_t *deviating) {
  int64_t half_edges = 3 * (int64_t)placed->net.triangle_count;
  deviation_loop loop = {placed, limit2, ORB_NEW(ctx, unsigned char, half_edges)};
  orb_edge_queue queue = {0};
  orb_status status = loop.deviating ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    orb_parallel_for(ctx, half_edges, 1024, deviation_range, &loop);
    status = orb_context_check(ctx);
  }
  for (int64_t h = 0; h < half_edges && status == ORB_OK; h++) {
    if (loop.deviating[h]) {
      status = orb_edge_queue_push(ctx, &queue, placed->net.triangles[h], placed->net.triangles[placed->net.twin[h]]);
    }
  }
  if (status == ORB_OK) {
    status = take_items_in(ctx, placed, limit2, &queue);
  }
  if (deviating) {
    *deviating = queue.count;
  }
  int64_t all = 6 * (int64_t)placed->item_begin[placed->shape_count]; /* half-edges of a net of all vertices */
  int64_t limit = 2 * (half_edges > all ? half_edges : all) + EDGES_FREE;
  if (status == ORB_OK) {
    status = repair_edges(ctx, placed, limit2, limit, &queue);
  }
  placed->gave_up |= queue.count > limit;
  orb_edge_queue_free(ctx, &queue);
  orb_free(ctx, loop.deviating);
  return status;
}
