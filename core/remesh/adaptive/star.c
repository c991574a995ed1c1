/* Stars: a disc of triangles is replaced by the star of one vertex. From the given triangles the disc grows over every
 * edge whose triangle of the star would be flipped on the sphere or inverted in space, like the incremental
 * construction of Delaunay triangulations (Watson 1981) with another test. A star amounts to the split of an edge or a
 * triangle (no vertex inside the disc), the move of a vertex (one), or the collapse of an edge to a free point (two),
 * each with as many edge flips as necessary. Every change is proved before it is made. */
#include "remesh/adaptive/star.h"

#include <string.h>

#include "base/check.h"
#include "numeric/predicates.h"
#include "remesh/placed/bound.h"
#include "remesh/placed/form.h"

enum { MOST = ORB_STAR_MOST }; /* sides of the disc */
enum { DISC = 48 };            /* triangles in the disc, the size of arrays on the stack */
enum { GROWTH = 12 };          /* triangles by which the disc may grow: more finds more stars and takes longer */
/* For ORB_STAR_SMALLER: the extent of the inverted triangles must fall below this share. Higher accepts more steps that
 * gain little. */
static const double MUCH_SMALLER = 0.6;

/* An edge of the disc's outline, and what is known of the star's triangle over it. */
typedef struct side {
  int32_t h;
  int possible;  /* the triangle is known to be positive */
  int judged;    /* `extent` is known */
  double extent; /* how large it is if inverted, else 0 */
} side;

typedef struct disc {
  orb_placed_net *placed;
  int32_t p; /* the vertex of the star: a number beyond the last vertex */
  int32_t triangle[DISC], inner[DISC];
  side side[MOST]; /* counter-clockwise */
  int count, n, inner_count;
  int located;      /* p is located on the shapes, which is done when first needed */
  double own[DISC]; /* the inverted extent of each current triangle; −1: not known yet */
  int32_t far_end,
      far_shape; /* the edge to this vertex was beyond the limit for another point, on this shape; −1: none */
} disc;

static int holds(const disc *d, int32_t t) {
  for (int i = 0; i < d->count; i++) {
    if (d->triangle[i] == t) {
      return 1;
    }
  }
  return 0;
}

static int is_among(const int32_t *list, int n, int32_t v) {
  for (int i = 0; i < n; i++) {
    if (list[i] == v) {
      return 1;
    }
  }
  return 0;
}

/* Finds the sides and the vertices inside; 0 if the triangles are not a disc, or it is too large. */
static int outline(disc *d) {
  const orb_net *net = &d->placed->net;
  int32_t ring[MOST];
  int borders = 0;
  int32_t first = -1;
  for (int i = 0; i < d->count; i++) {
    for (int k = 0; k < 3; k++) {
      int32_t h = 3 * d->triangle[i] + k;
      if (!holds(d, net->twin[h] / 3)) {
        borders++;
        first = first < 0 ? h : first;
      }
    }
  }
  d->n = 0;
  for (int32_t h = first; first >= 0;) {
    if (d->n == MOST || is_among(ring, d->n, net->triangles[h])) {
      return 0;
    }
    ring[d->n] = net->triangles[h];
    d->side[d->n++] = (side){.h = h};
    h = orb_next(h);
    while (holds(d, net->twin[h] / 3)) {
      h = orb_next(net->twin[h]);
    }
    if (h == first) {
      break;
    }
  }
  d->inner_count = 0;
  for (int i = 0; i < 3 * d->count; i++) {
    int32_t v = net->triangles[3 * d->triangle[i / 3] + i % 3];
    if (!is_among(ring, d->n, v) && !is_among(d->inner, d->inner_count, v)) {
      d->inner[d->inner_count++] = v;
    }
  }
  return d->n == borders && d->n >= 3 && d->count == d->n + 2 * d->inner_count - 2;
}

static void add_triangle(disc *d, int32_t t) {
  d->own[d->count] = -1;
  d->triangle[d->count++] = t;
}

/* Replaces `removed` sides from index i on, cyclically, by one or two. */
static void replace_sides(disc *d, int i, int removed, const int32_t *put, int count) {
  side kept[MOST + 1];
  int n = 0;
  for (int k = 0; k < count; k++) {
    kept[n++] = (side){.h = put[k]};
  }
  for (int k = removed; k < d->n; k++) {
    kept[n++] = d->side[(i + k) % d->n];
  }
  memcpy(d->side, kept, (size_t)n * sizeof *kept);
  d->n = n;
}

/* Grows the disc over side i = a→b by the triangle (b, a, c) beyond it. The triangle's other edges become sides, except
 * where one is the neighbouring side: then a or b lies inside. 0 if the result is not a disc, or too large. */
static int grow_over(disc *d, int i) {
  const orb_net *net = &d->placed->net;
  int32_t g = net->twin[d->side[i].h], put[2];
  int before = (i + d->n - 1) % d->n, after = (i + 1) % d->n, count = 0;
  int closes_a = net->twin[orb_next(g)] == d->side[before].h, closes_b = net->twin[orb_prev(g)] == d->side[after].h;
  int32_t apex = net->triangles[orb_prev(g)];
  for (int k = 0; k < d->n && !closes_a && !closes_b; k++) {
    if (net->triangles[d->side[k].h] == apex) {
      return 0;
    }
  }
  add_triangle(d, g / 3);
  if (!closes_a) {
    put[count++] = orb_next(g);
  } else {
    d->inner[d->inner_count++] = net->triangles[d->side[i].h];
  }
  if (!closes_b) {
    put[count++] = orb_prev(g);
  } else {
    d->inner[d->inner_count++] = net->triangles[orb_next(d->side[i].h)];
  }
  if (d->n + count - 1 - closes_a - closes_b > MOST) {
    return 0;
  }
  replace_sides(d, closes_a ? before : i, 1 + closes_a + closes_b, put, count);
  ORB_ASSERT(d->n < 3 || d->count == d->n + 2 * d->inner_count - 2);
  return d->n >= 3;
}

/* Whether the star's triangle at a side is clearly positive on the sphere. */
static int is_possible(const disc *d, side *over) {
  const orb_net *net = &d->placed->net;
  if (!over->possible) {
    int32_t a = net->triangles[over->h], b = net->triangles[orb_next(over->h)];
    over->possible = orb_net_clearly_positive(net, d->p, a, b);
  }
  return over->possible;
}

/* Its inverted extent. */
static double judge(const disc *d, side *over) {
  const orb_net *net = &d->placed->net;
  if (!over->judged) {
    int32_t a = net->triangles[over->h], b = net->triangles[orb_next(over->h)];
    over->judged = 1;
    over->extent = orb_placed_inverted_extent(d->placed, d->p, a, b);
  }
  return over->extent;
}

static int has_fixed(const disc *d) {
  for (int i = 0; i < d->inner_count; i++) {
    if (d->placed->fixed[d->inner[i]]) {
      return 1;
    }
  }
  return 0;
}

/* The first side whose triangle of the star is not possible; −1: none. */
static int impossible_side(disc *d) {
  for (int i = 0; i < d->n; i++) {
    if (!is_possible(d, &d->side[i])) {
      return i;
    }
  }
  return -1;
}

static orb_tally inverted_in(disc *d) {
  orb_tally sum = {0, 0};
  for (int i = 0; i < d->count; i++) {
    const int32_t *c = d->placed->net.triangles + 3 * (int64_t)d->triangle[i];
    d->own[i] = d->own[i] >= 0 ? d->own[i] : orb_placed_inverted_extent(d->placed, c[0], c[1], c[2]);
    orb_tally_add(&sum, d->own[i]);
  }
  return sum;
}

/* The first side whose triangle of the star is inverted; −1: none. Stops once there are too many for the goal. */
static int inverted_side(disc *d, orb_star_goal goal, orb_tally *star) {
  int first = -1, most = -1;
  *star = (orb_tally){0, 0};
  for (int32_t s = 0; s < d->placed->shape_count && !d->located; s++) {
    orb_placed_locate_on(d->placed, d->p, s);
  }
  d->located = 1;
  for (int i = 0; i < d->n; i++) {
    double extent = judge(d, &d->side[i]);
    orb_tally_add(star, extent);
    if (extent > 0 && first < 0) {
      first = i;
      most = inverted_in(d).inverted - (goal == ORB_STAR_FEWER);
    }
    if (first >= 0 && star->inverted > most) {
      break;
    }
  }
  return first;
}

/* Whether the listed items are within the limit of the star's triangles that hold them. A triangle holds an item that
 * lies left of the edge from p to its first corner, not left of that to the next, and within the outline. */
static int list_allows(const disc *d, int32_t list, double limit2) {
  const orb_placed_net *placed = d->placed;
  const double *p = orb_net_point(&placed->net, d->p);
  for (int32_t item = list; item >= 0; item = placed->item_next[item]) {
    const double *x = orb_placed_item_point(placed, item);
    int32_t a = placed->net.triangles[d->side[0].h];
    int begin = orb_orient(p, orb_net_point(&placed->net, a), x), here = begin;
    for (int i = 0; i < d->n; i++) {
      int32_t b = placed->net.triangles[orb_next(d->side[i].h)];
      int next = i + 1 < d->n ? orb_orient(p, orb_net_point(&placed->net, b), x) : begin;
      if (here >= 0 && next <= 0 &&
          orb_orient(orb_net_point(&placed->net, a), orb_net_point(&placed->net, b), x) >= 0 &&
          orb_placed_item2(placed, item, d->p, a, b) > limit2) {
        return 0;
      }
      a = b;
      here = next;
    }
  }
  return 1;
}

/* Whether the star's edges are within the limit. Tests first the one that was not for another point. */
static int edges_allow(disc *d, double limit2) {
  const orb_placed_net *placed = d->placed;
  for (int i = 0; i < d->n && d->far_end >= 0; i++) {
    if (placed->net.triangles[d->side[i].h] == d->far_end &&
        orb_placed_edge_within2(placed, d->far_shape, d->p, d->far_end, limit2) > limit2) {
      return 0;
    }
  }
  for (int i = 0; i < d->n; i++) {
    for (int32_t s = 0; s < placed->shape_count; s++) {
      if (orb_placed_edge_within2(placed, s, d->p, placed->net.triangles[d->side[i].h], limit2) > limit2) {
        d->far_end = placed->net.triangles[d->side[i].h];
        d->far_shape = s;
        return 0;
      }
    }
  }
  return 1;
}

/* The edges are tested first: where an item is beyond the limit, an edge almost always is too. */
static int is_within(disc *d, double limit2) {
  const orb_placed_net *placed = d->placed;
  if (!edges_allow(d, limit2)) {
    return 0;
  }
  for (int i = 0; i < d->count; i++) {
    if (!list_allows(d, placed->triangle_items[d->triangle[i]], limit2)) {
      return 0;
    }
  }
  for (int i = 0; i < d->inner_count; i++) {
    if (!list_allows(d, placed->vertex_items[d->inner[i]], limit2)) {
      return 0;
    }
  }
  return 1;
}

static void commit(orb_placed_net *placed, const disc *d) {
  int32_t lists[2 * DISC];
  int count = 0;
  for (int i = 0; i < d->count; i++) {
    lists[count++] = placed->triangle_items[d->triangle[i]];
    placed->triangle_items[d->triangle[i]] = -1;
  }
  for (int i = 0; i < d->inner_count; i++) {
    lists[count++] = placed->vertex_items[d->inner[i]];
    placed->vertex_items[d->inner[i]] = -1;
  }
  int32_t p = d->p;
  if (d->inner_count > 0) {
    p = d->inner[0];
    orb_placed_copy_vertex(placed, p, d->p);
  }
  placed->no_move[p] = 0;
  int32_t edges[MOST];
  for (int i = 0; i < d->n; i++) {
    edges[i] = d->side[i].h;
  }
  int32_t start = orb_net_star(&placed->net, d->triangle, d->count, edges, d->n, d->inner, d->inner_count, p);
  for (int i = 0; i < count; i++) {
    orb_placed_assign(placed, lists[i], start);
  }
}

static int is_better(disc *d, orb_tally star, orb_star_goal goal) {
  orb_tally now = inverted_in(d);
  return goal == ORB_STAR_FEWER ? star.inverted < now.inverted
                                : star.inverted <= now.inverted && star.extent < MUCH_SMALLER * now.extent;
}

/* Grows the disc until it has a star of p; 0: there is none. */
static int plan(disc *d, const double p[3], const orb_star_wish *wish) {
  int most = d->count + GROWTH < DISC ? d->count + GROWTH : DISC;
  memcpy(d->placed->net.points + 3 * (int64_t)d->p, p, 3 * sizeof(double));
  for (;;) {
    orb_tally star;
    int next = impossible_side(d);
    if (next < 0) {
      next = inverted_side(d, wish->goal, &star);
      if (d->inner_count >= wish->least_inner && is_better(d, star, wish->goal) && is_within(d, wish->limit2)) {
        return 1;
      }
    }
    if (next < 0 || d->count == most) {
      return 0;
    }
    if (!grow_over(d, next) || d->inner_count > wish->most_inner || has_fixed(d)) {
      return 0;
    }
  }
}

/* Plans in *d the star of the first point that has one; 0: none has. */
static int plan_first(disc *d, orb_placed_net *placed, int32_t vertex, const int32_t *triangles, int count,
                      const double (*points)[3], int point_count, const orb_star_wish *wish) {
  disc start = {.placed = placed, .p = vertex, .far_end = -1};
  ORB_ASSERT(vertex < placed->capacity);
  for (int i = 0; i < count && count <= DISC; i++) {
    add_triangle(&start, triangles[i]);
  }
  if (count > DISC || !outline(&start) || start.inner_count > wish->most_inner || has_fixed(&start)) {
    return 0;
  }
  orb_placed_copy_vertex(placed, vertex, placed->net.triangles[3 * (int64_t)triangles[0]]); /* hints for locating it */
  for (int i = 0; i < point_count; i++) {
    *d = start;
    if (plan(d, points[i], wish)) {
      return 1;
    }
    start.far_end = d->far_end;
    start.far_shape = d->far_shape;
    memcpy(start.own, d->own, (size_t)start.count * sizeof *start.own);
  }
  return 0;
}

int orb_adaptive_can_star(orb_placed_net *placed, const int32_t *triangles, int count, const double (*points)[3],
                          int point_count, const orb_star_wish *wish, int thread) {
  disc d;
  return plan_first(&d, placed, placed->net.vertex_count + thread, triangles, count, points, point_count, wish);
}

int orb_adaptive_star(orb_placed_net *placed, const int32_t *triangles, int count, const double (*points)[3],
                      int point_count, const orb_star_wish *wish) {
  disc d;
  if (!plan_first(&d, placed, placed->net.vertex_count, triangles, count, points, point_count, wish)) {
    return 0;
  }
  commit(placed, &d);
  return 1;
}
