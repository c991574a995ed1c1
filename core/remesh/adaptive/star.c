/* Stars: a disc of triangles is replaced by the star of one vertex. From the triangles it is given the disc grows over
 * every edge whose triangle of the star would be turned on the sphere or in space, as in the incremental construction
 * of Delaunay triangulations (Watson 1981) with another test. It stands for the split of an edge or a triangle (no
 * vertex inside the disc), the move of a vertex (one), the collapse of an edge to a free point (two), each with as many
 * turned edges as it takes. Nothing is changed that is not proved first. */
#include <math.h>
#include <string.h>

#include "base/check.h"
#include "numeric/predicates.h"
#include "remesh/adaptive/match.h"

enum { MOST = ORB_STAR_MOST, DISC = 48, GROWTH = 12 };

/* An edge of the disc's outline, and how far the triangle of the star over it is turned in space. */
typedef struct side {
  int32_t h;
  int possible, judged; /* it is known that the triangle can be; how far it is turned, too */
  double extent;
} side;

typedef struct disc {
  orb_match *match;
  int32_t p; /* the vertex of the star: a number after the last */
  int32_t triangle[DISC], inner[DISC];
  side side[MOST]; /* counter-clockwise */
  int count, n, inner_count;
  int placed;                 /* p is placed on the shapes; that is not done before it is asked for */
  int rough;                  /* triangles are judged by their corners only, until all else is found to be fine */
  double own[DISC];           /* how far each of its triangles is turned now; −1: not known yet */
  int32_t far_end, far_shape; /* the edge to this vertex strayed too far for another point, on this shape; −1: none */
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

/* The boundary and the vertices inside; 0 where it is no disc, or too large. */
static int outline(disc *d) {
  const orb_net *net = &d->match->net;
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

/* Takes `removed` sides out from number i on, round the end if need be, and puts one or two in their place. */
static void replace_sides(disc *d, int i, int removed, const int32_t *put, int count) {
  side turned[MOST + 1];
  int n = 0;
  for (int k = 0; k < count; k++) {
    turned[n++] = (side){.h = put[k]};
  }
  for (int k = removed; k < d->n; k++) {
    turned[n++] = d->side[(i + k) % d->n];
  }
  memcpy(d->side, turned, (size_t)n * sizeof *turned);
  d->n = n;
}

/* Grows the disc over side i, over the triangle (b, a, c) beyond a→b: its other sides are new ones of the outline,
 * where they are not the sides next to it, whose ends a or b come to lie inside. 0 where it would be no disc any more,
 * or too large. */
static int grow_over(disc *d, int i) {
  const orb_net *net = &d->match->net;
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

/* Whether there can be a triangle of the star at a side. */
static int is_possible(const disc *d, side *over) {
  const orb_net *net = &d->match->net;
  if (!over->possible) {
    int32_t a = net->triangles[over->h], b = net->triangles[orb_next(over->h)];
    over->possible = orb_orient(orb_net_point(net, d->p), orb_net_point(net, a), orb_net_point(net, b)) > 0 &&
                     orb_net_sound(net, d->p, a, b);
  }
  return over->possible;
}

/* How far it is turned in space. */
static double judge(const disc *d, side *over) {
  const orb_net *net = &d->match->net;
  if (!over->judged) {
    int32_t a = net->triangles[over->h], b = net->triangles[orb_next(over->h)];
    over->judged = 1;
    over->extent =
        d->rough ? orb_match_turned_by_corners(d->match, d->p, a, b) : orb_match_turned_extent(d->match, d->p, a, b);
  }
  return over->extent;
}

static int has_fixed(const disc *d) {
  for (int i = 0; i < d->inner_count; i++) {
    if (d->match->fixed[d->inner[i]]) {
      return 1;
    }
  }
  return 0;
}

/* The first side to grow over since its triangle of the star is impossible; −1: none. */
static int impossible_side(disc *d) {
  for (int i = 0; i < d->n; i++) {
    if (!is_possible(d, &d->side[i])) {
      return i;
    }
  }
  return -1;
}

static orb_tally turned_in(disc *d) {
  orb_tally sum = {0, 0};
  for (int i = 0; i < d->count; i++) {
    const int32_t *c = d->match->net.triangles + 3 * (int64_t)d->triangle[i];
    d->own[i] = d->own[i] >= 0 ? d->own[i] : orb_match_turned_extent(d->match, c[0], c[1], c[2]);
    orb_tally_add(&sum, d->own[i]);
  }
  return sum;
}

/* The first side whose triangle of the star is turned; −1: none. Once there are too many for the goal the rest is not
 * asked. */
static int turned_side(disc *d, orb_star_goal goal, orb_tally *star) {
  int first = -1, most = -1;
  *star = (orb_tally){0, 0};
  for (int32_t s = 0; s < d->match->shape_count && !d->placed; s++) {
    orb_match_place_on(d->match, d->p, s);
  }
  d->placed = 1;
  for (int i = 0; i < d->n; i++) {
    double extent = judge(d, &d->side[i]);
    orb_tally_add(star, extent);
    if (extent > 0 && first < 0) {
      first = i;
      most = turned_in(d).turned - (goal == ORB_STAR_FEWER);
    }
    if (first >= 0 && star->turned > most) {
      break;
    }
  }
  return first;
}

/* Whether the listed items are near enough to the triangles of the star that they lie in: left of the edge from p to
 * one corner, not left of that to the next, and within the outline. */
static int list_allows(const disc *d, int32_t list, double limit2) {
  const orb_match *match = d->match;
  const double *p = orb_net_point(&match->net, d->p);
  for (int32_t item = list; item >= 0; item = match->item_next[item]) {
    const double *x = orb_match_item_point(match, item);
    int32_t a = match->net.triangles[d->side[0].h];
    int begin = orb_orient(p, orb_net_point(&match->net, a), x), here = begin;
    for (int i = 0; i < d->n; i++) {
      int32_t b = match->net.triangles[orb_next(d->side[i].h)];
      int next = i + 1 < d->n ? orb_orient(p, orb_net_point(&match->net, b), x) : begin;
      if (here >= 0 && next <= 0 && orb_orient(orb_net_point(&match->net, a), orb_net_point(&match->net, b), x) >= 0 &&
          orb_match_item2(match, item, d->p, a, b) > limit2) {
        return 0;
      }
      a = b;
      here = next;
    }
  }
  return 1;
}

/* Whether the edges stay within the limit: first the one that did not for another point. */
static int edges_allow(disc *d, double limit2) {
  const orb_match *match = d->match;
  for (int i = 0; i < d->n && d->far_end >= 0; i++) {
    if (match->net.triangles[d->side[i].h] == d->far_end &&
        orb_match_edge_of_shape2(match, d->far_shape, d->p, d->far_end, limit2, NULL) > limit2) {
      return 0;
    }
  }
  for (int i = 0; i < d->n; i++) {
    for (int32_t s = 0; s < match->shape_count; s++) {
      if (orb_match_edge_of_shape2(match, s, d->p, match->net.triangles[d->side[i].h], limit2, NULL) > limit2) {
        d->far_end = match->net.triangles[d->side[i].h];
        d->far_shape = s;
        return 0;
      }
    }
  }
  return 1;
}

static int is_within(disc *d, double limit2) {
  const orb_match *match = d->match;
  for (int i = 0; i < d->count; i++) {
    if (!list_allows(d, match->triangle_items[d->triangle[i]], limit2)) {
      return 0;
    }
  }
  for (int i = 0; i < d->inner_count; i++) {
    if (!list_allows(d, match->vertex_items[d->inner[i]], limit2)) {
      return 0;
    }
  }
  return edges_allow(d, limit2);
}

static void commit(orb_match *match, const disc *d) {
  int32_t lists[2 * DISC];
  int count = 0;
  for (int i = 0; i < d->count; i++) {
    lists[count++] = match->triangle_items[d->triangle[i]];
    match->triangle_items[d->triangle[i]] = -1;
  }
  for (int i = 0; i < d->inner_count; i++) {
    lists[count++] = match->vertex_items[d->inner[i]];
    match->vertex_items[d->inner[i]] = -1;
  }
  int32_t p = d->p;
  if (d->inner_count > 0) {
    p = d->inner[0];
    orb_match_copy_vertex(match, p, d->p);
  }
  match->stayed[p] = 0;
  int32_t edges[MOST];
  for (int i = 0; i < d->n; i++) {
    edges[i] = d->side[i].h;
  }
  int32_t start = orb_net_star(&match->net, d->triangle, d->count, edges, d->n, d->inner, d->inner_count, p);
  for (int i = 0; i < count; i++) {
    orb_match_deal(match, lists[i], start);
  }
}

static int is_better(disc *d, orb_tally star, orb_star_goal goal) {
  if (goal == ORB_STAR_NOT_WORSE && star.turned == 0) {
    return 1;
  }
  orb_tally now = turned_in(d);
  switch (goal) {
    case ORB_STAR_NOT_WORSE:
      return !orb_tally_is_worse(star, now);
    case ORB_STAR_FEWER:
      return star.turned < now.turned;
    default:
      return star.turned <= now.turned && star.extent < 0.6 * now.extent;
  }
}

/* The same once more, by the centres of its triangles too. */
static int is_better_at_centres(disc *d, orb_star_goal goal) {
  orb_tally star = {0, 0};
  for (int i = 0; i < d->n; i++) {
    int32_t a = d->match->net.triangles[d->side[i].h], b = d->match->net.triangles[orb_next(d->side[i].h)];
    orb_tally_add(&star, orb_match_turned_extent(d->match, d->p, a, b));
  }
  return is_better(d, star, goal);
}

/* Finds a star of p, from the outline of what is given on; 0: there is none. */
static int plan(disc *d, const double p[3], const orb_star_wish *wish) {
  int most = d->count + GROWTH < DISC ? d->count + GROWTH : DISC;
  memcpy(d->match->net.points + 3 * (int64_t)d->p, p, 3 * sizeof(double));
  for (;;) {
    orb_tally star;
    int next = impossible_side(d);
    if (next < 0) {
      next = turned_side(d, wish->goal, &star);
      if (d->inner_count >= wish->least_inner && is_better(d, star, wish->goal) && is_within(d, wish->limit2) &&
          (!d->rough || is_better_at_centres(d, wish->goal))) {
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

/* The first of the points that has a star, planned in *d; 0: none. */
static int plan_first(disc *d, orb_match *match, int32_t vertex, const int32_t *triangles, int count,
                      const double (*points)[3], int point_count, const orb_star_wish *wish) {
  disc start = {.match = match, .p = vertex, .far_end = -1, .rough = wish->goal == ORB_STAR_NOT_WORSE};
  ORB_ASSERT(vertex < match->capacity);
  for (int i = 0; i < count && count <= DISC; i++) {
    add_triangle(&start, triangles[i]);
  }
  if (count > DISC || !outline(&start) || start.inner_count > wish->most_inner || has_fixed(&start)) {
    return 0;
  }
  orb_match_copy_vertex(match, vertex, match->net.triangles[3 * (int64_t)triangles[0]]); /* hints for its places */
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

int orb_match_can_star(orb_match *match, const int32_t *triangles, int count, const double (*points)[3],
                       int point_count, const orb_star_wish *wish, int thread) {
  disc d;
  return plan_first(&d, match, match->net.vertex_count + thread, triangles, count, points, point_count, wish);
}

int orb_match_star(orb_match *match, const int32_t *triangles, int count, const double (*points)[3], int point_count,
                   const orb_star_wish *wish) {
  disc d;
  if (!plan_first(&d, match, match->net.vertex_count, triangles, count, points, point_count, wish)) {
    return 0;
  }
  commit(match, &d);
  return 1;
}
