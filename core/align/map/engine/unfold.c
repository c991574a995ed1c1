/* Unfolding by collapses.
 *
 * A vertex may be collapsed onto a neighbour that sees the whole ring. Then the ring is a fan of positive triangles
 * from one of its vertices, its kernel is not empty, and the collapsed vertex can always come back into it. So vertices
 * of flipped triangles are collapsed until no flip is left; then they come back in reverse order. If no collapse lowers
 * the number of flips, one that keeps it still removes a vertex of the fold. Nothing moves but the collapsed vertices
 * and their rings. As soon as a vertex is back, it and its ring move towards their old places or, where they are
 * cramped, to the middles of their rings: kernels inside kernels shrink fast, and without these moves doubles cannot
 * hold what comes back into a large fold.
 *
 * Source: Shen, Jiang, Zorin & Panozzo 2019, "Progressive embedding" (collapse until nothing is flipped, and optimise
 * around each vertex that comes back).
 *
 * An optimiser (untangle.h) leaves better triangles, but it can end with flips that it never clears.
 */
#include "align/map/engine/unfold.h"

#include <math.h>
#include <string.h>

#include "align/sheet/collapse.h"
#include "base/check.h"
#include "base/memory.h"
#include "embed/common/kernel.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

enum {
  RING_MOST = 64, /* neighbours of a vertex that is collapsed; larger stars stay */
};
/* Which collapses are allowed. */
enum allowed {
  FEWER, /* those that lower the number of flips */
  EQUAL, /* of vertices of flipped triangles, those that do not raise it */
  THIN   /* of any vertex: with fewer vertices, folds are simpler */
};
/* Least determinants of a triangle over its squared edge on the ring. With the first, a vertex comes back to where it
 * was; with more than the second, it may move. The first is what doubles hold with ease, the second a fifth of an
 * equilateral triangle. */
static const double WELL_INSIDE = 0.02, SEATED = 0.1;
static const double GAIN = 1.02;      /* a cramped vertex moves if that raises its least determinant by this factor */
enum { HALVINGS = 3, RELAXINGS = 2 }; /* of a way that is tried; of a ring around a vertex that is back */

typedef struct collapse {
  int32_t vertex, first, count; /* its ring: entries of `ring` */
} collapse;

typedef struct unfolding {
  orb_context *ctx;
  orb_map_level *l;
  int32_t *triangle, *twin, *corner; /* half-edge 3t + k leaves triangle[3t + k]; corner: one that leaves a vertex */
  unsigned char *flipped;            /* of each triangle, while vertices collapse; those that are gone are not */
  int32_t *queue, queue_count;       /* vertices to look at */
  unsigned char *queued;
  collapse *done;
  int32_t done_count;
  int32_t *ring, *spoke, ring_count, ring_capacity; /* spoke: the half-edge to each entry of `ring` */
  const double *home; /* where the vertices were, 3 each; NULL: they do not return there */
  int32_t flips;
} unfolding;

static const double *at(const unfolding *u, int32_t v) {
  return u->l->x + 3 * (size_t)v;
}

static int is_flipped(const unfolding *u, int32_t a, int32_t b, int32_t c) {
  return orb_orient(at(u, a), at(u, b), at(u, c)) <= 0;
}

/* The half-edges that leave v, counter-clockwise; 0: there are too many. */
static int star_of(const unfolding *u, int32_t v, int32_t star[RING_MOST]) {
  int count = 0;
  int32_t h = u->corner[v];
  do {
    if (count == RING_MOST) {
      return 0;
    }
    star[count++] = h;
    h = u->twin[orb_prev(h)];
  } while (h != u->corner[v]);
  return count;
}

static int32_t end_of(const unfolding *u, int32_t h) {
  return u->triangle[orb_next(h)];
}

/* Are the two vertices opposite to the edge from v to its neighbour k the only common neighbours? */
static int link_is_clean(const unfolding *u, const int32_t *star, int count, int k) {
  int32_t around[RING_MOST];
  int n = star_of(u, end_of(u, star[k]), around), common = 0;
  for (int i = 0; i < n; i++) {
    for (int j = 0; j < count; j++) {
      common += end_of(u, around[i]) == end_of(u, star[j]);
    }
  }
  return n > 0 && common == 2 && n + count - 4 < RING_MOST;
}

/* Flipped triangles of the fan that neighbour k makes of the ring; more than `most` where there are more. */
static int fan_flips(const unfolding *u, const int32_t *ring, int count, int k, int most) {
  int flips = 0;
  for (int i = 1; i + 1 < count && flips <= most; i++) {
    flips += is_flipped(u, ring[k], ring[(k + i) % count], ring[(k + i + 1) % count]);
  }
  return flips;
}

/* The least fatness of a triangle of that fan. */
static double fan_fatness(const unfolding *u, const int32_t *ring, int count, int k) {
  double least = INFINITY;
  for (int i = 1; i + 1 < count; i++) {
    double fat = orb_fatness(at(u, ring[k]), at(u, ring[(k + i) % count]), at(u, ring[(k + i + 1) % count]));
    least = fat < least ? fat : least;
  }
  return least;
}

static int star_flips(const unfolding *u, const int32_t *star, int count) {
  int flips = 0;
  for (int i = 0; i < count; i++) {
    flips += u->flipped[star[i] / 3];
  }
  return flips;
}

/* Notes whether a triangle is flipped. */
static void look_at(unfolding *u, int32_t t) {
  const int32_t *v = u->triangle + 3 * (size_t)t;
  u->flipped[t] = (unsigned char)is_flipped(u, v[0], v[1], v[2]);
}

static void ask(unfolding *u, int32_t v) {
  if (!u->queued[v]) {
    u->queued[v] = 1;
    u->queue[u->queue_count++] = v;
  }
}

static void join(unfolding *u, int32_t g, int32_t h) {
  u->twin[g] = h;
  u->twin[h] = g;
}

/* Collapses v onto its neighbour k. */
static void apply(unfolding *u, int32_t v, const int32_t *star, int count, int k) {
  int32_t onto = end_of(u, star[k]), first = star[k], last = star[(k + count - 1) % count];
  u->done[u->done_count++] = (collapse){v, u->ring_count, count};
  for (int i = 0; i < count; i++) {
    int32_t a = end_of(u, star[(k + i) % count]);
    u->spoke[u->ring_count] = star[(k + i) % count];
    u->ring[u->ring_count++] = a;
    ask(u, a);
  }
  /* Triangle of `first` is (v, onto, a1), that of `last` is (v, a(n-1), onto): both go. */
  int32_t a1 = end_of(u, star[(k + 1) % count]), an = end_of(u, last);
  for (int i = 1; i + 1 < count; i++) {
    u->triangle[star[(k + i) % count]] = onto;
    look_at(u, star[(k + i) % count] / 3);
  }
  int32_t right_out = u->twin[orb_next(first)], right_in = u->twin[orb_prev(first)];
  int32_t left_out = u->twin[orb_next(last)], left_in = u->twin[last];
  join(u, right_out, right_in);
  join(u, left_out, left_in);
  u->flipped[first / 3] = u->flipped[last / 3] = 0;
  u->corner[onto] = right_in;
  u->corner[a1] = right_out;
  u->corner[an] = left_in;
  u->corner[v] = -1;
}

/* Undoes a collapse. The removed triangles still know their neighbours. */
static void split(unfolding *u, const collapse *c) {
  const int32_t *spoke = u->spoke + c->first, *ring = u->ring + c->first;
  const int32_t first = spoke[0], last = spoke[c->count - 1];
  for (int32_t i = 1; i + 1 < c->count; i++) {
    u->triangle[spoke[i]] = c->vertex;
  }
  join(u, u->twin[orb_next(first)], orb_next(first));
  join(u, u->twin[orb_prev(first)], orb_prev(first));
  join(u, u->twin[orb_next(last)], orb_next(last));
  join(u, u->twin[last], last);
  u->corner[c->vertex] = first;
  u->corner[ring[0]] = orb_next(first);
  u->corner[ring[1]] = orb_prev(first);
  u->corner[ring[c->count - 1]] = orb_next(last);
}

/* The neighbour that v is collapsed onto: one that leaves the fewest flips, *flips, at most `most`, and of these the
 * fattest fan; -1: none. Few neighbours leave so few flips, so their number is looked at first. */
static int best_neighbour(const unfolding *u, const int32_t *star, int count, int most, int *flips) {
  int32_t ring[RING_MOST];
  int best = -1;
  double fattest = -INFINITY;
  for (int k = 0; k < count; k++) {
    ring[k] = end_of(u, star[k]);
  }
  *flips = most;
  for (int k = 0; k < count; k++) {
    const int found = fan_flips(u, ring, count, k, *flips);
    if (found > *flips) {
      continue;
    }
    const double fat = fan_fatness(u, ring, count, k);
    if ((best < 0 || found < *flips || fat > fattest) && link_is_clean(u, star, count, k)) {
      best = k;
      *flips = found;
      fattest = fat;
    }
  }
  return best;
}

/* Collapses v if `allowed`. Returns whether it did. */
static int try_vertex(unfolding *u, int32_t v, enum allowed allowed) {
  int32_t star[RING_MOST];
  if (u->l->pinned[v] || u->corner[v] < 0) {
    return 0;
  }
  int count = star_of(u, v, star), left;
  int before = star_flips(u, star, count);
  if (count < 3 || (before == 0 && allowed != THIN) || u->ring_count + count > u->ring_capacity) {
    return 0;
  }
  int best = best_neighbour(u, star, count, allowed == FEWER ? before - 1 : before, &left);
  if (best < 0) {
    return 0;
  }
  apply(u, v, star, count, best);
  u->flips += left - before;
  return 1;
}

/* Looks at the queued vertices until no collapse lowers the number of flips. */
static void run_queue(unfolding *u) {
  while (u->queue_count > 0) {
    int32_t v = u->queue[--u->queue_count];
    u->queued[v] = 0;
    (void)try_vertex(u, v, FEWER);
  }
}

/* Collapses one vertex near a flipped triangle: one of its own, or a neighbour of these. Returns whether it did. */
static int try_triangle(unfolding *u, int32_t t, enum allowed allowed) {
  for (int k = 0; k < 3; k++) {
    int32_t star[RING_MOST], v = u->triangle[3 * (size_t)t + (size_t)k];
    if (try_vertex(u, v, allowed)) {
      return 1;
    }
    int count = allowed == THIN ? star_of(u, v, star) : 0;
    for (int i = 0; i < count; i++) {
      if (try_vertex(u, end_of(u, star[i]), THIN)) {
        return 1;
      }
    }
  }
  return 0;
}

/* One collapse near each flipped triangle. Returns whether there was any. */
static int collapse_some(unfolding *u, enum allowed allowed) {
  int any = 0;
  for (int32_t t = 0; t < u->l->triangle_count && u->flips > 0; t++) {
    if (u->flipped[t] && try_triangle(u, t, allowed)) {
      any = 1;
      run_queue(u);
    }
  }
  return any;
}

/* Every collapse removes a vertex, so this ends. */
static void collapse_all(unfolding *u) {
  int any = 1;
  run_queue(u);
  while (u->flips > 0 && any) {
    any = collapse_some(u, EQUAL) || collapse_some(u, THIN);
  }
}

/* Does the point lie well inside the ring? */
static int is_inside(const double (*ring)[3], int32_t count, const double p[3]) {
  for (int32_t i = 0; i < count; i++) {
    const double *a = ring[i], *b = ring[i + 1 < count ? i + 1 : 0];
    if (!(orb_det(p, a, b) > WELL_INSIDE * orb_distance2(a, b))) {
      return 0;
    }
  }
  return 1;
}

/* The ring of a vertex that may move, in its order. */
typedef struct one_ring {
  int count;
  double at[RING_MOST + 1][3]; /* the last one is the first one again */
  double length2[RING_MOST];   /* of its edges, squared */
} one_ring;

static void gather_ring(const unfolding *u, const int32_t *star, int count, one_ring *out) {
  out->count = count;
  for (int i = 0; i < count; i++) {
    memcpy(out->at[i], at(u, end_of(u, star[i])), sizeof out->at[i]);
  }
  memcpy(out->at[count], out->at[0], sizeof out->at[0]);
  for (int i = 0; i < count; i++) {
    out->length2[i] = orb_distance2(out->at[i], out->at[i + 1]);
  }
}

/* How well a ring holds the point p: its least determinant over squared edge. Not positive: p flips a triangle. */
static double seat_of(const one_ring *ring, const double p[3]) {
  double least = INFINITY;
  for (int i = 0; i < ring->count; i++) {
    least = fmin(least, orb_det(p, ring->at[i], ring->at[i + 1]) / ring->length2[i]);
  }
  return least;
}

/* Whether p flips no triangle of the ring, decided exactly. */
static int flips_nothing(const one_ring *ring, const double p[3]) {
  for (int i = 0; i < ring->count; i++) {
    if (orb_orient(p, ring->at[i], ring->at[i + 1]) <= 0) {
      return 0;
    }
  }
  return 1;
}

/* Moves x, which its ring holds so well `now`, towards a point as far as the ring holds it with at least `enough`, or
 * better than now. */
static int approach(double x[3], const one_ring *ring, double now, const double to[3], double enough) {
  double share = 1;
  for (int i = 0; i < HALVINGS; i++, share /= 2) {
    double p[3];
    for (int k = 0; k < 3; k++) {
      p[k] = x[k] + share * (to[k] - x[k]);
    }
    orb_normalize(p);
    const double there = seat_of(ring, p);
    if ((there >= enough || there > GAIN * now) && flips_nothing(ring, p)) {
      memcpy(x, p, sizeof p);
      return 1;
    }
  }
  return 0;
}

/* Moves v home as far as its star holds it well, or else, if it is cramped, towards the middle of its ring. */
static void relax(unfolding *u, int32_t v) {
  int32_t star[RING_MOST];
  one_ring ring;
  double *x = u->l->x + 3 * (size_t)v, middle[3] = {0};
  const int count = u->l->pinned[v] ? 0 : star_of(u, v, star);
  if (count < 3) {
    return;
  }
  gather_ring(u, star, count, &ring);
  const double now = seat_of(&ring, x);
  if ((u->home && approach(x, &ring, now, u->home + 3 * (size_t)v, SEATED)) || now >= SEATED) {
    return;
  }
  for (int i = 0; i < 3 * count; i++) {
    middle[i % 3] += ring.at[i / 3][i % 3] / count;
  }
  (void)approach(x, &ring, now, middle, INFINITY);
}

/* Relaxes a vertex that is back, and its ring. */
static void relax_around(unfolding *u, const collapse *c) {
  for (int i = 0; i < RELAXINGS; i++) {
    relax(u, c->vertex);
    for (int32_t k = 0; k < c->count; k++) {
      relax(u, u->ring[c->first + k]);
    }
  }
}

/* Brings back the collapsed vertices, the last one first. */
static orb_status bring_back(unfolding *u, int *all) {
  orb_kernel_room room = {0};
  orb_status status = ORB_OK;
  *all = 1;
  for (int32_t i = u->done_count - 1; i >= 0 && *all && status == ORB_OK; i--) {
    const collapse *c = &u->done[i];
    double ring[RING_MOST][3], p[3];
    for (int32_t k = 0; k < c->count; k++) {
      memcpy(ring[k], at(u, u->ring[c->first + k]), sizeof ring[k]);
    }
    memcpy(p, at(u, c->vertex), sizeof p);
    if (!u->home || !is_inside((const double(*)[3])ring, c->count, p)) {
      status = orb_kernel_point(u->ctx, &room, (const double(*)[3])ring, c->count, p, all);
    }
    if (status == ORB_OK && *all) {
      memcpy(u->l->x + 3 * (size_t)c->vertex, p, sizeof p);
      split(u, c);
      relax_around(u, c);
    }
  }
  orb_kernel_room_free(u->ctx, &room);
  return status;
}

/* Half-edges of the level. Its triangles are a closed surface. */
static orb_status build(unfolding *u) {
  const orb_map_level *l = u->l;
  size_t h = 3 * (size_t)l->triangle_count, n = (size_t)l->count;
  u->triangle = ORB_NEW(u->ctx, int32_t, h);
  u->twin = ORB_NEW(u->ctx, int32_t, h);
  u->corner = ORB_NEW(u->ctx, int32_t, n);
  u->flipped = ORB_NEW(u->ctx, unsigned char, l->triangle_count);
  u->queue = ORB_NEW(u->ctx, int32_t, n);
  u->queued = ORB_NEW0(u->ctx, unsigned char, n);
  u->done = ORB_NEW(u->ctx, collapse, n);
  u->ring_capacity = 16 * l->count;
  u->ring = ORB_NEW(u->ctx, int32_t, u->ring_capacity);
  u->spoke = ORB_NEW(u->ctx, int32_t, u->ring_capacity);
  if (!u->triangle || !u->twin || !u->corner || !u->flipped || !u->queue || !u->queued || !u->done || !u->ring ||
      !u->spoke) {
    return ORB_E_NO_MEMORY;
  }
  memcpy(u->triangle, l->triangle, h * sizeof *u->triangle);
  ORB_TRY(orb_mesh_twins(u->ctx, u->triangle, l->triangle_count, l->count, u->twin));
  for (size_t i = 0; i < h; i++) {
    u->corner[u->triangle[i]] = (int32_t)i;
  }
  for (int32_t t = 0; t < l->triangle_count; t++) {
    look_at(u, t);
  }
  return ORB_OK;
}

static void unfolding_free(unfolding *u) {
  orb_free(u->ctx, u->triangle);
  orb_free(u->ctx, u->twin);
  orb_free(u->ctx, u->corner);
  orb_free(u->ctx, u->flipped);
  orb_free(u->ctx, u->queue);
  orb_free(u->ctx, u->queued);
  orb_free(u->ctx, u->done);
  orb_free(u->ctx, u->ring);
  orb_free(u->ctx, u->spoke);
}

/* Collapses what is flipped. */
static void collapse_flips(unfolding *u) {
  for (int32_t t = 0; t < u->l->triangle_count; t++) {
    for (int k = 0; k < 3 && u->flipped[t]; k++) {
      ask(u, u->triangle[3 * (size_t)t + (size_t)k]);
    }
  }
  collapse_all(u);
}

/* Collapses what is marked. */
static void collapse_marked(unfolding *u, const unsigned char *mark) {
  for (int any = 1; any;) {
    any = 0;
    for (int32_t v = 0; v < u->l->count; v++) {
      any |= mark[v] && try_vertex(u, v, THIN);
    }
    while (u->queue_count > 0) {
      u->queued[u->queue[--u->queue_count]] = 0;
    }
  }
}

/* Collapses what is marked, or what is flipped where mark is NULL, and brings it back. *all 0: that cannot be done, and
 * nothing has changed. */
static orb_status run(unfolding *u, const unsigned char *mark, int *all) {
  const size_t size = 3 * (size_t)u->l->count * sizeof(double);
  double *before = ORB_NEW(u->ctx, double, 3 * (size_t)u->l->count);
  orb_status status = before ? ORB_OK : ORB_E_NO_MEMORY;
  *all = 0;
  if (status != ORB_OK) {
    goto done;
  }
  memcpy(before, u->l->x, size);
  u->home = mark ? NULL : before;
  ORB_GO(status, build(u), done);
  if (mark) {
    collapse_marked(u, mark);
  } else {
    collapse_flips(u);
  }
  if (u->flips == 0) {
    ORB_GO(status, bring_back(u, all), done);
  }
  if (!*all) {
    memcpy(u->l->x, before, size);
  }
done:
  orb_free(u->ctx, before);
  unfolding_free(u);
  return status;
}

orb_status orb_map_level_unfold(orb_context *ctx, orb_map_level *l, int32_t *left) {
  unfolding u = {.ctx = ctx, .l = l, .flips = orb_map_level_flips(l)};
  int all;
  *left = u.flips;
  if (*left == 0) {
    return ORB_OK;
  }
  ORB_TRY(run(&u, NULL, &all));
  *left = all ? 0 : *left;
  return ORB_OK;
}

orb_status orb_map_level_set_anew(orb_context *ctx, orb_map_level *l, const unsigned char *mark) {
  unfolding u = {.ctx = ctx, .l = l};
  int all; /* otherwise the level stays as it is, which is right too */
  return run(&u, mark, &all);
}
