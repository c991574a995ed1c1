/* Two neighbours become one vertex between them: the triangles around both are replaced by the star of a point on the
 * edge. Succeeds where neither can move onto the other.
 *
 * A merge is proved before it is made, but most pairs cannot merge, so what costs little decides first: a guess of the
 * new edges' deviations from the normals at the vertices alone drops hopeless pairs, and the proof begins with the
 * edges that are the likeliest to fail. A pass searches all pairs in parallel, then merges those that can, the least
 * deviating first, one after another; the next pass searches the pairs beside them. */
#include "remesh/adaptive/merge.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"
#include "remesh/placed/bound.h"
#include "remesh/placed/form.h"

enum { MOST = ORB_STAR_MOST }; /* sides of the star of a merged vertex: pairs with more stay apart */
/* Points tried, as shares of the way from u to v: more find a few more merges and take longer. */
static const double WAY[] = {0.5, 0.25, 0.75, 0, 1};
enum { POINTS = sizeof WAY / sizeof *WAY };
/* How much is tried. Squared guesses and deviations are in units of the squared limit; higher values find a few more
 * merges and take longer. */
typedef struct effort {
  double pair;  /* a pair is dropped if the greatest guess at its middle is above this */
  double point; /* a point is dropped if the greatest guess is above this */
  double far;   /* a point is dropped if an edge deviates by more */
  int points;   /* points tried for a pair */
  int passes;   /* over all pairs; the fourth finds a hundredth of the merges */
} effort;
static const effort THOROUGH = {3, 2, 2.5, POINTS, 4}, QUICK = {1.5, 1.1, 2, 3, 2};
/* A point is dropped too if the greatest guess from the normals at its places is above this. */
static const double GUESS_SPOT = 2.5;
/* A point from which an edge is beyond the limit is pulled along it, up to PULLS times, by the share of its length that
 * brings a circular arc within the limit and by PULL_MORE, at most PULL_MOST: without PULL_MORE pulls creep, and long
 * ones leave the room that the other edges have. */
enum { PULLS = 3 };
static const double PULL_MORE = 0.03, PULL_MOST = 0.3;
/* Pulls end once an edge is beyond the limit by more than PROGRESS times what the last one was. */
static const double PROGRESS = 1.1;
enum { LIKELY = 2 }; /* edges on each shape tested before the others: most points fail at one of them */
enum { PASSES = 4 }; /* the fourth finds less than a hundredth of all merges */
enum { GRAIN = 64 }; /* vertices a thread takes at a time */

typedef struct candidate {
  double guess;
  int32_t u, v;
} candidate;

typedef struct merge_loop {
  orb_placed_net *placed;
  double limit2;
  const effort *effort;
  unsigned char *changed; /* per vertex: a triangle at it is new since its pairs were searched */
  candidate *found;       /* per vertex: the best pair that it is the lower number of; v −1: none */
} merge_loop;

/* Two neighbours and the triangles around both. */
typedef struct pair {
  orb_placed_net *placed;
  double limit2;
  const effort *effort;
  int32_t u, v, p; /* p: the vertex that stands for the merged one, a number beyond the last vertex */
  int32_t ring[MOST], side[MOST], triangle[MOST + 2]; /* side i, a half-edge, leads from ring i to the next */
  int n, count;
  orb_tally now; /* the inverted triangles around both; inverted −1: not counted yet */
  int far;       /* the ring vertex to which an edge was last found beyond the limit; −1: none */
  int32_t far_shape;
  double far2; /* and by how much, in units of the squared limit */
} pair;

/* An edge of the star, to a ring vertex. */
typedef struct spoke {
  double guess2;
  int to;
} spoke;

/* Appends the triangles around the origin of h from that after h to that before the twin of h, or all, and their outer
 * sides. Returns 0 if there are too many. */
static int take_fan(pair *s, int32_t h, int shared) {
  const orb_net *net = &s->placed->net;
  int32_t last = net->twin[h], e = h;
  do {
    int inside = e / 3 == h / 3 || e / 3 == last / 3;
    if (!inside || shared) {
      if (s->count == MOST + 2) {
        return 0;
      }
      s->triangle[s->count++] = e / 3;
    }
    if (!inside) {
      if (s->n == MOST) {
        return 0;
      }
      s->side[s->n] = orb_next(e);
      s->ring[s->n++] = net->triangles[orb_next(e)];
    }
    e = net->twin[orb_prev(e)];
  } while (e != h);
  return 1;
}

/* Whether the ends have exactly two neighbours in common, given how many of the ring belong to u. */
static int is_disc(const pair *s, int of_u) {
  for (int i = 1; i < of_u; i++) { /* ring[0] and ring[of_u] are the two in common */
    for (int k = of_u + 1; k < s->n; k++) {
      if (s->ring[i] == s->ring[k]) {
        return 0;
      }
    }
  }
  return s->n >= 3;
}

/* Gathers the pair of h = u→v; 0: it cannot merge. */
static int take_pair(const merge_loop *loop, int32_t h, int32_t p, pair *s) {
  orb_placed_net *placed = loop->placed;
  s->placed = placed;
  s->limit2 = loop->limit2;
  s->effort = loop->effort;
  s->u = placed->net.triangles[h];
  s->v = placed->net.triangles[orb_next(h)];
  s->p = p;
  s->n = s->count = 0;
  s->now.inverted = -1;
  s->far = -1;
  if (!take_fan(s, h, 1)) {
    return 0;
  }
  int of_u = s->n;
  return take_fan(s, placed->net.twin[h], 0) && is_disc(s, of_u);
}

/* The greatest guess over the edges of the star of the point at `way`, in units of the squared limit, from the
 * positions and normals at u and v alone. */
static double guess_at(const pair *s, double way) {
  const orb_placed_net *placed = s->placed;
  double greatest = 0;
  for (int32_t shape = 0; shape < placed->shape_count; shape++) {
    const double *a = orb_placed_position(placed, s->u, shape), *b = orb_placed_position(placed, s->v, shape);
    const double *m = orb_placed_normal(placed, s->u, shape), *n = orb_placed_normal(placed, s->v, shape);
    double at[3], normal[3];
    for (int k = 0; k < 3; k++) {
      at[k] = a[k] + way * (b[k] - a[k]);
      normal[k] = m[k] + way * (n[k] - m[k]);
    }
    (void)orb_normalize(normal);
    for (int i = 0; i < s->n; i++) {
      const double *c = orb_placed_position(placed, s->ring[i], shape);
      const double *o = orb_placed_normal(placed, s->ring[i], shape);
      double height8 = (c[0] - at[0]) * (o[0] - normal[0]) + (c[1] - at[1]) * (o[1] - normal[1]) +
                       (c[2] - at[2]) * (o[2] - normal[2]);
      greatest = height8 * height8 > greatest ? height8 * height8 : greatest;
    }
  }
  return greatest / (64 * s->limit2);
}

static int is_positive(const pair *s) {
  const orb_net *net = &s->placed->net;
  for (int i = 0; i < s->n; i++) {
    if (!orb_net_clearly_positive(net, s->p, s->ring[i], s->ring[i + 1 < s->n ? i + 1 : 0])) {
      return 0;
    }
  }
  return 1;
}

static orb_tally count_now(pair *s) {
  if (s->now.inverted < 0) {
    s->now = (orb_tally){0, 0};
    for (int i = 0; i < s->count; i++) {
      const int32_t *c = s->placed->net.triangles + 3 * (int64_t)s->triangle[i];
      orb_tally_add(&s->now, orb_placed_inverted_extent(s->placed, c[0], c[1], c[2]));
    }
  }
  return s->now;
}

/* Whether the star has no more inverted triangles than the pair, and no larger ones. */
static int keeps_upright(pair *s, double (*extent)(const orb_placed_net *, int32_t, int32_t, int32_t)) {
  orb_tally star = {0, 0};
  for (int i = 0; i < s->n; i++) {
    orb_tally_add(&star, extent(s->placed, s->p, s->ring[i], s->ring[(i + 1) % s->n]));
  }
  return star.inverted == 0 || !orb_tally_is_worse(star, count_now(s));
}

/* Lists the LIKELY edges of the star that are the likeliest to be beyond the limit on the shape. Returns the greatest
 * guess. */
static double likely_far(const pair *s, int32_t shape, spoke likely[LIKELY]) {
  for (int i = 0; i < LIKELY; i++) {
    likely[i] = (spoke){-1, 0};
  }
  for (int i = 0; i < s->n; i++) {
    spoke next = {orb_placed_edge_guess2(s->placed, shape, s->p, s->ring[i]), i};
    for (int k = 0; k < LIKELY && next.guess2 > likely[LIKELY - 1].guess2; k++) {
      if (next.guess2 > likely[k].guess2) {
        spoke moved = likely[k];
        likely[k] = next;
        next = moved;
      }
    }
  }
  return likely[0].guess2;
}

static int edge_allows(pair *s, int to, int32_t shape) {
  double distance2 = orb_placed_edge_within2(s->placed, shape, s->p, s->ring[to], s->limit2);
  if (distance2 <= s->limit2) {
    return 1;
  }
  s->far2 = distance2 / s->limit2;
  s->far = to;
  s->far_shape = shape;
  return 0;
}

enum { ALLOWED, FAR, NOT_ALLOWED };
/* Places p on the shape and tests the edges that are the likeliest to be beyond the limit there, first the one that was
 * for the last point. */
static int test_likely(pair *s, int32_t shape) {
  spoke likely[LIKELY];
  orb_placed_locate_on(s->placed, s->p, shape);
  if (s->far >= 0 && s->far_shape == shape && !edge_allows(s, s->far, shape)) {
    return FAR;
  }
  if (likely_far(s, shape, likely) > GUESS_SPOT * s->limit2) {
    return NOT_ALLOWED;
  }
  for (int i = 0; i < LIKELY; i++) {
    if (!edge_allows(s, likely[i].to, shape)) {
      return FAR;
    }
  }
  return ALLOWED;
}

static int test_edges(pair *s) {
  int32_t shapes = s->placed->shape_count, first = s->far >= 0 ? s->far_shape : 0;
  for (int32_t k = 0; k < shapes; k++) {
    int result = test_likely(s, (first + k) % shapes);
    if (result != ALLOWED) {
      return result;
    }
  }
  for (int32_t shape = 0; shape < shapes; shape++) {
    for (int i = 0; i < s->n; i++) {
      if (!edge_allows(s, i, shape)) {
        return FAR;
      }
    }
  }
  return ALLOWED;
}

/* Whether the listed items are within the limit of the star's triangles that hold them. */
static int list_allows(const pair *s, int32_t list) {
  const orb_placed_net *placed = s->placed;
  const double *p = orb_net_point(&placed->net, s->p);
  for (int32_t item = list; item >= 0; item = placed->item_next[item]) {
    const double *x = orb_placed_item_point(placed, item);
    for (int i = 0; i < s->n; i++) {
      int32_t a = s->ring[i], b = s->ring[(i + 1) % s->n];
      const double *q = orb_net_point(&placed->net, a), *r = orb_net_point(&placed->net, b);
      if (orb_orient(p, q, x) >= 0 && orb_orient(r, p, x) >= 0 && orb_orient(q, r, x) >= 0 &&
          orb_placed_item2(placed, item, s->p, a, b) > s->limit2) {
        return 0;
      }
    }
  }
  return 1;
}

static int items_allow(const pair *s) {
  int fine = list_allows(s, s->placed->vertex_items[s->u]) && list_allows(s, s->placed->vertex_items[s->v]);
  for (int i = 0; i < s->count && fine; i++) {
    fine = list_allows(s, s->placed->triangle_items[s->triangle[i]]);
  }
  return fine;
}

/* Places p on the way from u to v. */
static void place(pair *s, double way) {
  const double *a = orb_net_point(&s->placed->net, s->u), *b = orb_net_point(&s->placed->net, s->v);
  double *p = s->placed->net.points + 3 * (int64_t)s->p;
  for (int k = 0; k < 3; k++) {
    p[k] = a[k] + way * (b[k] - a[k]);
  }
  (void)orb_normalize(p);
}

/* Moves p towards the far end of the edge that was beyond the limit. The deviation of an arc grows with the square of
 * its length. */
static void pull(pair *s) {
  double way = fmin(PULL_MOST, PULL_MORE + 1 - 1 / sqrt(sqrt(s->far2)));
  const double *b = orb_net_point(&s->placed->net, s->ring[s->far]);
  double *p = s->placed->net.points + 3 * (int64_t)s->p;
  for (int k = 0; k < 3; k++) {
    p[k] += way * (b[k] - p[k]);
  }
  (void)orb_normalize(p);
}

/* Tests everything that a merge at p must keep. */
static int test(pair *s) {
  int result = is_positive(s) ? test_edges(s) : NOT_ALLOWED;
  if (result != ALLOWED) {
    return result == FAR && s->far2 < s->effort->far ? FAR : NOT_ALLOWED;
  }
  return keeps_upright(s, orb_placed_inverted_by_corners) && items_allow(s) &&
                 keeps_upright(s, orb_placed_inverted_extent)
             ? ALLOWED
             : NOT_ALLOWED;
}

/* Whether there is a point at which the pair may merge, the most promising first, and its guess; −1: none. */
static int find_point(pair *s, double *guess) {
  double at[POINTS];
  for (int i = 0; i < POINTS; i++) {
    at[i] = guess_at(s, WAY[i]);
    if (i == 0 && at[i] > s->effort->pair) {
      return -1;
    }
  }
  orb_placed_copy_vertex(s->placed, s->p, s->u); /* hints for locating it */
  for (int starts = 0; starts < s->effort->points; starts++) {
    int best = 0;
    for (int i = 1; i < POINTS; i++) {
      best = at[i] < at[best] ? i : best;
    }
    if (!(at[best] <= s->effort->point)) {
      return -1;
    }
    place(s, WAY[best]);
    int result = test(s);
    for (int k = 0; k < PULLS && result == FAR; k++) {
      double before = s->far2;
      pull(s);
      result = test(s);
      if (result == FAR && s->far2 > PROGRESS * before) {
        break;
      }
    }
    if (result == ALLOWED) {
      *guess = at[best];
      return best;
    }
    at[best] = INFINITY;
  }
  return -1;
}

static void merge(pair *s) {
  orb_placed_net *placed = s->placed;
  int32_t lists[MOST + 4], inner[2] = {s->u, s->v};
  int count = 0;
  for (int i = 0; i < s->count; i++) {
    lists[count++] = placed->triangle_items[s->triangle[i]];
    placed->triangle_items[s->triangle[i]] = -1;
  }
  for (int i = 0; i < 2; i++) {
    lists[count++] = placed->vertex_items[inner[i]];
    placed->vertex_items[inner[i]] = -1;
  }
  orb_placed_copy_vertex(placed, s->u, s->p);
  placed->no_move[s->u] = 0;
  (void)orb_net_star(&placed->net, s->triangle, s->count, s->side, s->n, inner, 2, s->u);
  for (int i = 0; i < count; i++) {
    orb_placed_assign_among(placed, lists[i], s->triangle, s->n);
  }
}

/* The best neighbour of a greater number to merge with. */
static candidate find_best(const merge_loop *loop, int32_t u, int32_t p) {
  orb_placed_net *placed = loop->placed;
  const orb_net *net = &placed->net;
  candidate best = {INFINITY, u, -1};
  int32_t first = net->out[u], h = first;
  if (first < 0 || placed->fixed[u]) {
    return best;
  }
  do {
    int32_t v = net->triangles[orb_next(h)];
    double guess;
    pair s;
    if (u < v && !placed->fixed[v] && (loop->changed[u] || loop->changed[v]) && take_pair(loop, h, p, &s) &&
        find_point(&s, &guess) >= 0 && guess < best.guess) {
      best = (candidate){guess, u, v};
    }
    h = net->twin[orb_prev(h)];
  } while (h != first);
  return best;
}

static void find_range(void *arg, int64_t begin, int64_t end, int thread) {
  merge_loop *loop = arg;
  for (int64_t u = begin; u < end; u++) {
    loop->found[u] = find_best(loop, (int32_t)u, loop->placed->net.vertex_count + thread);
  }
}

static int compare(const void *one, const void *other) {
  const candidate *a = one, *b = other;
  return a->guess != b->guess ? (a->guess < b->guess ? -1 : 1) : (a->u > b->u) - (a->u < b->u);
}

/* Merges u and v if that is still possible. */
static int try_merge(merge_loop *loop, int32_t u, int32_t v) {
  orb_placed_net *placed = loop->placed;
  const orb_net *net = &placed->net;
  int32_t h = net->out[u] >= 0 && net->out[v] >= 0 ? orb_net_edge(net, u, v) : -1;
  double guess;
  pair s;
  if (h < 0 || !take_pair(loop, h, net->vertex_count, &s) || find_point(&s, &guess) < 0) {
    return 0;
  }
  merge(&s);
  loop->changed[u] = 1;
  for (int i = 0; i < s.n; i++) {
    loop->changed[s.ring[i]] = 1;
  }
  return 1;
}

static orb_status pass(orb_context *ctx, merge_loop *loop, int64_t most, int64_t *merged) {
  int64_t n = loop->placed->net.vertex_count, count = 0;
  *merged = 0;
  orb_parallel_for(ctx, n, GRAIN, find_range, loop);
  ORB_TRY(orb_context_check(ctx));
  for (int64_t u = 0; u < n; u++) {
    loop->changed[u] = 0;
    if (loop->found[u].v >= 0) {
      loop->found[count++] = loop->found[u];
    }
  }
  qsort(loop->found, (size_t)count, sizeof *loop->found, compare);
  for (int64_t i = 0; i < count && *merged < most; i++) {
    *merged += try_merge(loop, loop->found[i].u, loop->found[i].v);
    ORB_TRY(orb_context_check(ctx));
  }
  return ORB_OK;
}

orb_status orb_adaptive_merge_all(orb_context *ctx, orb_placed_net *placed, double limit2, int64_t target, int quick) {
  int32_t n = placed->net.vertex_count;
  int64_t live = orb_placed_live(placed), merged = 1;
  merge_loop loop = {placed, limit2, quick ? &QUICK : &THOROUGH, ORB_NEW(ctx, unsigned char, n),
                     ORB_NEW(ctx, candidate, n)};
  orb_status status = loop.changed && loop.found ? orb_placed_reserve(ctx, placed, orb_threads(ctx)) : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    memset(loop.changed, 1, (size_t)n);
  }
  for (int i = 0; i < loop.effort->passes && merged > 0 && live > target && live > 4 && status == ORB_OK; i++) {
    int64_t most = (live - (target > 4 ? target : 4) + 1) / 2;
    status = pass(ctx, &loop, most, &merged);
    live -= 2 * merged;
  }
  orb_free(ctx, loop.changed);
  orb_free(ctx, loop.found);
  return status;
}
