/* Making a match hold: edges that stray are turned where the other diagonal strays less, else split where they stray
 * most, at the crossing itself. And turns for the sake of well-shaped triangles, which never leave the tolerance. */
#include <math.h>
#include <string.h>

#include "base/check.h"
#include "numeric/predicates.h"
#include "remesh/adaptive/edge_queue.h"
#include "remesh/adaptive/match.h"
#include "remesh/distance.h"

static double items_of_turn2(const orb_match *match, int32_t list, int32_t c, int32_t d, int32_t b, int32_t a) {
  double greatest = 0;
  for (int32_t i = list; i >= 0; i = match->item_next[i]) {
    int left =
        orb_orient(orb_net_point(&match->net, c), orb_net_point(&match->net, d), orb_match_item_point(match, i)) >= 0;
    double distance2 = left ? orb_match_item2(match, i, c, d, b) : orb_match_item2(match, i, d, c, a);
    greatest = distance2 > greatest ? distance2 : greatest;
  }
  return greatest;
}

static void turn(orb_match *match, int32_t h) {
  int32_t t = h / 3, g = match->net.twin[h] / 3;
  int32_t lists[2] = {match->triangle_items[t], match->triangle_items[g]};
  match->triangle_items[t] = match->triangle_items[g] = -1;
  orb_net_flip(&match->net, h);
  orb_match_deal(match, lists[0], t);
  orb_match_deal(match, lists[1], t);
}

/* The forms of the two triangles on either side of edge a b, and of those on either side of c d instead. */
static void forms_of_turn(const orb_match *match, int32_t a, int32_t b, int32_t c, int32_t d, orb_form *before,
                          orb_form *after) {
  *before = orb_form_join(orb_match_form(match, a, b, c), orb_match_form(match, b, a, d));
  *after = orb_form_join(orb_match_form(match, c, d, b), orb_match_form(match, d, c, a));
}

/* Whether more triangles are turned in space after a turn of edge a b than before. */
static int turn_turns(const orb_match *match, int32_t a, int32_t b, int32_t c, int32_t d) {
  orb_tally before = {0, 0}, after = {0, 0};
  orb_tally_add(&after, orb_match_turned_extent(match, c, d, b));
  orb_tally_add(&after, orb_match_turned_extent(match, d, c, a));
  if (after.turned == 0) {
    return 0;
  }
  orb_tally_add(&before, orb_match_turned_extent(match, a, b, c));
  orb_tally_add(&before, orb_match_turned_extent(match, b, a, d));
  return orb_tally_is_worse(after, before);
}

/* Whether a turn of edge h, beside triangles of this form, would make them better in space, whatever else may forbid
 * it. */
static int turn_is_better(const orb_match *match, int32_t h, orb_form before) {
  const orb_net *net = &match->net;
  int32_t g = net->twin[h], a = net->triangles[h], b = net->triangles[g];
  int32_t c = net->triangles[orb_prev(h)], d = net->triangles[orb_prev(g)];
  orb_form after = orb_match_form(match, c, d, b);
  double wanted = before.quality * 1.05 + 1e-9;
  if (after.quality <= wanted && (before.facing > 0 || after.facing <= 0)) {
    return 0;
  }
  after = orb_form_join(after, orb_match_form(match, d, c, a));
  return (after.quality > wanted || (before.facing <= 0 && after.facing > 0)) && orb_form_allows(before, after);
}

static orb_form form_of(const orb_match *match, int32_t t) {
  const int32_t *c = match->net.triangles + 3 * (int64_t)t;
  return c[0] >= 0 ? orb_match_form(match, c[0], c[1], c[2]) : ORB_FORM_BEST;
}

/* Whether the limit lets it be turned. */
static int can_turn(const orb_match *match, int32_t h, double limit2) {
  const orb_net *net = &match->net;
  int32_t g = net->twin[h];
  int32_t a = net->triangles[h], b = net->triangles[g];
  int32_t c = net->triangles[orb_prev(h)], d = net->triangles[orb_prev(g)];
  if (!orb_net_can_flip(net, h) || turn_turns(match, a, b, c, d)) {
    return 0;
  }
  return limit2 == INFINITY || (orb_match_edge2(match, c, d, limit2, NULL) <= limit2 &&
                                items_of_turn2(match, match->triangle_items[h / 3], c, d, b, a) <= limit2 &&
                                items_of_turn2(match, match->triangle_items[g / 3], c, d, b, a) <= limit2);
}

int orb_match_try_turn(orb_match *match, int32_t h, double limit2) {
  orb_form before = orb_form_join(form_of(match, h / 3), form_of(match, match->net.twin[h] / 3));
  int can = turn_is_better(match, h, before) && can_turn(match, h, limit2);
  if (can) {
    turn(match, h);
  }
  return can;
}

enum { PASSES = 6 };

typedef struct turn_loop {
  const orb_match *match;
  double limit2;
  int only_bad;
  orb_form *form;         /* a triangle */
  unsigned char *may;     /* a half-edge: it is to be turned, as things are; 0 where neither triangle is to be seen */
  unsigned char *stale;   /* a triangle: what is known of its edges is not true any more */
  unsigned char *changed; /* a triangle: in this pass */
} turn_loop;

static void form_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  turn_loop *loop = arg;
  for (int64_t t = begin; t < end; t++) {
    if (loop->stale[t]) {
      loop->form[t] = form_of(loop->match, (int32_t)t);
    }
  }
}

/* Whether edge h would be turned for the sake of the triangles beside it. */
static int is_to_turn(const turn_loop *loop, int32_t h) {
  orb_form before = orb_form_join(loop->form[h / 3], loop->form[loop->match->net.twin[h] / 3]);
  return (!loop->only_bad || before.turned || before.slivers) && turn_is_better(loop->match, h, before) &&
         can_turn(loop->match, h, loop->limit2);
}

static void may_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  turn_loop *loop = arg;
  const orb_net *net = &loop->match->net;
  for (int64_t h = begin; h < end; h++) {
    if (net->triangles[h - h % 3] < 0 || h > net->twin[h]) {
      loop->may[h] = 0;
    } else if (loop->stale[h / 3] || loop->stale[net->twin[h] / 3]) {
      loop->may[h] = (unsigned char)is_to_turn(loop, (int32_t)h);
    }
  }
}

/* Whether edge h may be turned now: as was found, if its triangles are as they were, else it waits for the next pass;
 * but for the edge that would be new, which may have come to be elsewhere. */
static int may_now(const turn_loop *loop, int32_t h) {
  const orb_net *net = &loop->match->net;
  return loop->may[h] && !loop->changed[h / 3] && !loop->changed[net->twin[h] / 3] &&
         !orb_net_adjacent(net, net->triangles[orb_prev(h)], net->triangles[orb_prev(net->twin[h])]);
}

/* One edge after another, as was found for them side by side. */
static orb_status turn_pass(orb_context *ctx, orb_match *match, turn_loop *loop, int64_t *turned) {
  const orb_net *net = &match->net;
  int32_t half_edges = 3 * net->triangle_count;
  *turned = 0;
  memset(loop->changed, 0, (size_t)net->triangle_count);
  orb_parallel_for(ctx, net->triangle_count, 512, form_range, loop);
  orb_parallel_for(ctx, half_edges, 1024, may_range, loop);
  ORB_TRY(orb_context_check(ctx));
  for (int32_t h = 0; h < half_edges; h++) {
    if (may_now(loop, h)) {
      turn(match, h);
      loop->changed[h / 3] = loop->changed[net->twin[h] / 3] = 1;
      ++*turned;
    }
    if ((h & 4095) == 0) {
      ORB_TRY(orb_context_check(ctx));
    }
  }
  unsigned char *stale = loop->stale;
  loop->stale = loop->changed;
  loop->changed = stale;
  return ORB_OK;
}

orb_status orb_match_turn_all(orb_context *ctx, orb_match *match, double limit2, int only_bad) {
  int64_t triangles = match->net.triangle_count, turned = triangles;
  turn_loop loop = {.match = match, .limit2 = limit2, .only_bad = only_bad};
  loop.form = ORB_NEW(ctx, orb_form, triangles);
  loop.may = ORB_NEW(ctx, unsigned char, 3 * triangles);
  loop.stale = ORB_NEW(ctx, unsigned char, triangles);
  loop.changed = ORB_NEW(ctx, unsigned char, triangles);
  orb_status status = loop.form && loop.may && loop.stale && loop.changed ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    memset(loop.stale, 1, (size_t)triangles);
  }
  for (int pass = 0; pass < PASSES && turned * 200 >= triangles && status == ORB_OK; pass++) {
    status = turn_pass(ctx, match, &loop, &turned);
  }
  orb_free(ctx, loop.form);
  orb_free(ctx, loop.may);
  orb_free(ctx, loop.stale);
  orb_free(ctx, loop.changed);
  return status;
}

void orb_match_crossing_point(const orb_match *match, int32_t v, int32_t w, const orb_stray *stray, double out[3]) {
  const orb_sphere_view *view = &match->view[stray->shape];
  const double *c = view->points + 3 * (int64_t)view->triangles[stray->h];
  if (stray->at_vertex) {
    out[0] = c[0];
    out[1] = c[1];
    out[2] = c[2];
    return;
  }
  const double *d = view->points + 3 * (int64_t)view->triangles[orb_next(stray->h)];
  const double *p = orb_net_point(&match->net, v), *q = orb_net_point(&match->net, w);
  /* on c d, where the plane of p q cuts it: weights are the distances of c and d from that plane */
  double wc = fabs(orb_det(p, q, c)), wd = fabs(orb_det(p, q, d)), sum = wc + wd;
  double t = sum > 0 ? wc / sum : 0.5;
  for (int k = 0; k < 3; k++) {
    out[k] = (1 - t) * c[k] + t * d[k];
  }
  (void)orb_normalize(out);
}

/* Turns the edge whatever it does to the form, if all stays positive on the sphere. */
static int force_turn(orb_match *match, int32_t h) {
  const orb_net *net = &match->net;
  int32_t g = net->twin[h], a = net->triangles[h], b = net->triangles[g];
  int32_t c = net->triangles[orb_prev(h)], d = net->triangles[orb_prev(g)];
  const double *p = orb_net_point(net, a), *q = orb_net_point(net, b);
  const double *r = orb_net_point(net, c), *s = orb_net_point(net, d);
  if (c == d || orb_net_adjacent(net, c, d) || orb_orient(r, s, q) <= 0 || orb_orient(s, r, p) <= 0) {
    return 0;
  }
  turn(match, h);
  return 1;
}

/* Turns the straying edge if the other diagonal is within the limit and no triangle turns over. */
static int mend_by_turn(orb_match *match, int32_t h, double limit2) {
  const orb_net *net = &match->net;
  int32_t g = net->twin[h], v = net->triangles[h], w = net->triangles[g];
  int32_t c = net->triangles[orb_prev(h)], d = net->triangles[orb_prev(g)];
  orb_form before, after;
  forms_of_turn(match, v, w, c, d, &before, &after);
  if (!orb_net_can_flip(net, h) || !orb_form_allows(before, after) ||
      orb_match_edge2(match, c, d, limit2, NULL) > limit2 ||
      items_of_turn2(match, match->triangle_items[h / 3], c, d, w, v) > limit2 ||
      items_of_turn2(match, match->triangle_items[g / 3], c, d, w, v) > limit2) {
    return 0;
  }
  turn(match, h);
  return 1;
}

/* The longest edge of the triangle of h, if that is a needle (flat to a thousandth) and the edge is not h; else −1. */
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
  return longest > 0 && orb_det(p[0], p[1], p[2]) < 1e-3 * length2[longest] ? edge[longest] : -1;
}

/* Splits edge h at the foot of p, well away from its ends. */
static int32_t split_near(orb_match *match, int32_t h, const double p[3]) {
  const double *a = orb_net_point(&match->net, match->net.triangles[h]);
  const double *b = orb_net_point(&match->net, match->net.triangles[orb_next(h)]);
  double ab[3], ap[3], x[3];
  orb_sub(b, a, ab);
  orb_sub(p, a, ap);
  double t = fmin(0.9, fmax(0.1, orb_dot(ab, ap) / orb_dot(ab, ab)));
  for (int k = 0; k < 3; k++) {
    x[k] = a[k] + t * ab[k];
  }
  (void)orb_normalize(x);
  return orb_match_split(match, h, x);
}

/* Splits the edge where it strays most. Beside a needle its longest edge is split first, and so on: else splits creep
 * towards that edge in ever thinner triangles (as in Rivara's longest-edge bisection). */
static int32_t split_at(orb_match *match, int32_t h, const orb_stray *worst) {
  const orb_net *net = &match->net;
  double p[3];
  orb_match_crossing_point(match, net->triangles[h], net->triangles[net->twin[h]], worst, p);
  int32_t split = h;
  for (int step = 0; step < 64; step++) {
    int32_t longer = longest_of_needle(net, split);
    if (longer < 0) {
      longer = longest_of_needle(net, net->twin[split]);
    }
    if (longer < 0) {
      break;
    }
    split = longer;
  }
  int32_t n = split == h ? orb_match_split(match, h, p) : split_near(match, split, p);
  return n >= 0 ? n : split_near(match, h, p);
}

/* An edge between needles so thin that no rounded point lies within it: the crossing becomes a vertex wherever it lies,
 * and the edge is turned, which makes the needles' other edges its successors. */
static orb_status give_room(orb_context *ctx, orb_match *match, int32_t h, const orb_stray *worst,
                            orb_edge_queue *queue) {
  const orb_net *net = &match->net;
  int32_t v = net->triangles[h], w = net->triangles[net->twin[h]], before = net->vertex_count;
  double p[3];
  orb_match_crossing_point(match, v, w, worst, p);
  int32_t n = orb_match_insert(match, h / 3, p);
  if (n >= before) {
    ORB_TRY(orb_edge_queue_push_star(ctx, queue, net, n));
  }
  h = orb_net_edge(net, v, w);
  if (h < 0 || !force_turn(match, h)) {
    return ORB_OK;
  }
  return orb_edge_queue_push(ctx, queue, net->triangles[h], net->triangles[net->twin[h]]);
}

/* `ahead` tells where the edge strays most; of shape −1 where that is not known yet. */
static orb_status mend_edge(orb_context *ctx, orb_match *match, int32_t v, int32_t w, double limit2, orb_stray ahead,
                            orb_edge_queue *queue) {
  int32_t h = orb_net_edge(&match->net, v, w);
  if (h >= 0 && ahead.shape < 0) {
    (void)orb_match_edge2(match, v, w, INFINITY, &ahead);
  }
  if (h < 0 || ahead.distance2 <= limit2 || mend_by_turn(match, h, limit2)) {
    return ORB_OK;
  }
  ORB_TRY(orb_match_reserve(ctx, match, 1));
  int32_t n = split_at(match, h, &ahead);
  if (n < 0) {
    return give_room(ctx, match, h, &ahead, queue);
  }
  ORB_TRY(orb_edge_queue_push_star(ctx, queue, &match->net, n));
  return orb_edge_queue_push(ctx, queue, v, w); /* still there if another edge was split */
}

typedef struct stray_loop {
  orb_match *match;
  double limit2;
  unsigned char *strays; /* a half-edge */
} stray_loop;

/* A mark of an edge and the limit: found at its half-edge, it was proved to stay within. */
static uint64_t mark_of_edge(const orb_match *match, int32_t v, int32_t w, double limit2) {
  uint64_t mark = orb_mixed(1, &limit2, sizeof limit2);
  mark = orb_mixed(mark, orb_net_point(&match->net, v), 3 * sizeof(double));
  mark = orb_mixed(mark, orb_net_point(&match->net, w), 3 * sizeof(double));
  return mark ? mark : 1;
}

static void stray_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  stray_loop *loop = arg;
  orb_match *match = loop->match;
  const orb_net *net = &match->net;
  for (int64_t h = begin; h < end; h++) {
    loop->strays[h] = 0;
    if (net->triangles[h - h % 3] < 0 || h > net->twin[h]) {
      continue;
    }
    int32_t v = net->triangles[h], w = net->triangles[net->twin[h]];
    uint64_t mark = mark_of_edge(match, v, w, loop->limit2);
    if (match->within[h] != mark) {
      loop->strays[h] = orb_match_edge2(match, v, w, loop->limit2, NULL) > loop->limit2;
      match->within[h] = loop->strays[h] ? 0 : mark;
    }
  }
}

enum { AHEAD = 1024 };

/* Where edges of the queue stray, found side by side before they come up: their ends stay where they are. */
typedef struct ahead_loop {
  const orb_match *match;
  const int32_t (*ends)[2];
  orb_stray *worst;
} ahead_loop;

static void ahead_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  ahead_loop *loop = arg;
  for (int64_t i = begin; i < end; i++) {
    int32_t v = loop->ends[i][0], w = loop->ends[i][1];
    loop->worst[i] = (orb_stray){0, -1, -1, 0};
    if (orb_net_edge(&loop->match->net, v, w) >= 0) {
      (void)orb_match_edge2(loop->match, v, w, INFINITY, &loop->worst[i]);
    }
  }
}

/* First in, first out: an old long edge is split before those that its neighbours' splits have made, which would else
 * creep towards it in ever thinner triangles. */
static orb_status mend_edges(orb_context *ctx, orb_match *match, double limit2, int64_t limit, orb_edge_queue *queue) {
  orb_stray *worst = ORB_NEW(ctx, orb_stray, AHEAD);
  orb_status status = worst ? ORB_OK : ORB_E_NO_MEMORY;
  for (int64_t i = 0; i < queue->count && i < limit && status == ORB_OK;) {
    int64_t count = queue->count - i < AHEAD ? queue->count - i : AHEAD;
    ahead_loop loop = {match, (const int32_t(*)[2])queue->ends + i, worst};
    orb_parallel_for(ctx, count, 32, ahead_range, &loop);
    status = orb_context_check(ctx);
    for (int64_t k = 0; k < count && i < limit && status == ORB_OK; k++, i++) {
      status = mend_edge(ctx, match, queue->ends[i][0], queue->ends[i][1], limit2, worst[k], queue);
    }
  }
  orb_free(ctx, worst);
  return status;
}

/* The item of triangle t that is farthest from it, if that is beyond the limit; else −1. */
static int32_t farthest_item(const orb_match *match, int32_t t, double limit2) {
  const int32_t *c = match->net.triangles + 3 * (int64_t)t;
  int32_t farthest = -1;
  for (int32_t i = match->triangle_items[t]; i >= 0; i = match->item_next[i]) {
    double distance2 = orb_match_item2(match, i, c[0], c[1], c[2]);
    if (distance2 > limit2) {
      limit2 = distance2;
      farthest = i;
    }
  }
  return farthest;
}

/* Makes vertices of the items that stray from their triangles, the farthest of each triangle first. */
static orb_status take_items_in(orb_context *ctx, orb_match *match, double limit2, orb_edge_queue *queue) {
  for (int32_t t = 0; t < match->net.triangle_count; t++) { /* new triangles come at the end and are looked at, too */
    int32_t item = match->net.triangles[3 * (int64_t)t] < 0 ? -1 : farthest_item(match, t, limit2);
    if (item < 0) {
      continue;
    }
    ORB_TRY(orb_match_reserve(ctx, match, 1));
    int32_t n = orb_match_insert(match, t, orb_match_item_point(match, item));
    ORB_TRY(orb_edge_queue_push_star(ctx, queue, &match->net, n));
    t -= farthest_item(match, t, limit2) >= 0; /* others may still stray from what is left of it */
  }
  return ORB_OK;
}

orb_status orb_match_refine(orb_context *ctx, orb_match *match, double limit2, int64_t *strays) {
  int64_t half_edges = 3 * (int64_t)match->net.triangle_count;
  stray_loop loop = {match, limit2, ORB_NEW(ctx, unsigned char, half_edges)};
  orb_edge_queue queue = {0};
  orb_status status = loop.strays ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    orb_parallel_for(ctx, half_edges, 1024, stray_range, &loop);
    status = orb_context_check(ctx);
  }
  for (int64_t h = 0; h < half_edges && status == ORB_OK; h++) {
    if (loop.strays[h]) {
      status = orb_edge_queue_push(ctx, &queue, match->net.triangles[h], match->net.triangles[match->net.twin[h]]);
    }
  }
  if (status == ORB_OK) {
    status = take_items_in(ctx, match, limit2, &queue);
  }
  if (strays) {
    *strays = queue.count;
  }
  int64_t limit = 2 * half_edges + 20000;
  if (status == ORB_OK) {
    status = mend_edges(ctx, match, limit2, limit, &queue);
  }
  match->crept |= queue.count > limit;
  orb_edge_queue_free(ctx, &queue);
  orb_free(ctx, loop.strays);
  return status;
}
