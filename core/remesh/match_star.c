/* Stars: a disc of triangles is replaced by the star of one vertex. From the triangles it is given the disc grows over
 * every edge whose triangle of the star would be turned on the sphere or in space, as in the incremental construction
 * of Delaunay triangulations (Watson 1981) with another test. It stands for the split of an edge or a triangle (no
 * vertex inside the disc), the move of a vertex (one), the collapse of an edge to a free point (two), each with as many
 * turned edges as it takes. Nothing is changed that is not proved first. */
#include <math.h>
#include <string.h>

#include "base/check.h"
#include "numeric/predicates.h"
#include "remesh/match.h"

enum { MOST = ORB_STAR_MOST, DISC = 48, GROWTH = 12, KNOWN = 96 };

typedef struct disc {
  orb_match *match;
  int32_t p; /* the vertex of the star: a number after the last */
  int32_t triangle[DISC], edge[MOST], inner[DISC];
  int count, n, inner_count;
  int rough;            /* triangles are judged by their corners only, until all else is found to be fine */
  double own[DISC];     /* how far each of its triangles is turned now; −1: not known yet */
  int32_t known[KNOWN]; /* edges whose triangle of the star has been judged */
  double extent[KNOWN]; /* turned; negative: impossible */
  int known_count;
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
    d->edge[d->n++] = h;
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

/* How far the triangle of the star at edge h is turned in space; −1 where there can be none. */
static double judge(disc *d, int32_t h) {
  const orb_net *net = &d->match->net;
  for (int i = 0; i < d->known_count; i++) {
    if (d->known[i] == h) {
      return d->extent[i];
    }
  }
  int32_t a = net->triangles[h], b = net->triangles[orb_next(h)];
  double extent = -1;
  if (orb_orient(orb_net_point(net, d->p), orb_net_point(net, a), orb_net_point(net, b)) > 0 &&
      orb_net_sound(net, d->p, a, b)) {
    extent =
        d->rough ? orb_match_turned_by_corners(d->match, d->p, a, b) : orb_match_turned_extent(d->match, d->p, a, b);
  }
  if (d->known_count < KNOWN) {
    d->known[d->known_count] = h;
    d->extent[d->known_count++] = extent;
  }
  return extent;
}

static int has_fixed(const disc *d) {
  for (int i = 0; i < d->inner_count; i++) {
    if (d->match->fixed[d->inner[i]]) {
      return 1;
    }
  }
  return 0;
}

/* The next triangle to grow over, beyond an edge whose triangle of the star is impossible (*possible is 0 then), else
 * turned; −1: none. */
static int32_t beyond(disc *d, orb_tally *star, int *possible) {
  const orb_net *net = &d->match->net;
  int32_t next = -1;
  *star = (orb_tally){0, 0};
  *possible = 1;
  for (int i = 0; i < d->n; i++) {
    double extent = judge(d, d->edge[i]);
    if (extent < 0) {
      *possible = 0;
      return net->twin[d->edge[i]] / 3;
    }
    next = extent > 0 && next < 0 ? net->twin[d->edge[i]] / 3 : next;
    orb_tally_add(star, extent);
  }
  return next;
}

static int list_allows(const disc *d, int32_t list, double limit2) {
  const orb_match *match = d->match;
  const double *p = orb_net_point(&match->net, d->p);
  for (int32_t item = list; item >= 0; item = match->item_next[item]) {
    const double *x = orb_match_item_point(match, item);
    for (int i = 0; i < d->n; i++) {
      int32_t a = match->net.triangles[d->edge[i]], b = match->net.triangles[orb_next(d->edge[i])];
      const double *q = orb_net_point(&match->net, a), *r = orb_net_point(&match->net, b);
      if (orb_orient(p, q, x) >= 0 && orb_orient(r, p, x) >= 0 && orb_orient(q, r, x) >= 0 &&
          orb_match_item2(match, item, d->p, a, b) > limit2) {
        return 0;
      }
    }
  }
  return 1;
}

static int is_within(const disc *d, double limit2) {
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
  for (int i = 0; i < d->n; i++) {
    if (orb_match_edge2(match, d->p, match->net.triangles[d->edge[i]], limit2, NULL) > limit2) {
      return 0;
    }
  }
  return 1;
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
  int32_t start = orb_net_star(&match->net, d->triangle, d->count, d->edge, d->n, d->inner, d->inner_count, p);
  for (int i = 0; i < count; i++) {
    orb_match_deal(match, lists[i], start);
  }
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

static void add_triangle(disc *d, int32_t t) {
  d->own[d->count] = -1;
  d->triangle[d->count++] = t;
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
    int32_t a = d->match->net.triangles[d->edge[i]], b = d->match->net.triangles[orb_next(d->edge[i])];
    orb_tally_add(&star, orb_match_turned_extent(d->match, d->p, a, b));
  }
  return is_better(d, star, goal);
}

/* Finds a star of p, from the outline of what is given on; 0: there is none. */
static int plan(disc *d, const double p[3], const orb_star_wish *wish) {
  int most = d->count + GROWTH < DISC ? d->count + GROWTH : DISC;
  orb_match_place(d->match, d->p, p);
  for (;;) {
    orb_tally star;
    int possible;
    int32_t next = beyond(d, &star, &possible);
    if (possible && d->inner_count >= wish->least_inner && is_better(d, star, wish->goal) &&
        is_within(d, wish->limit2) && (!d->rough || is_better_at_centres(d, wish->goal))) {
      return 1;
    }
    if (next < 0 || d->count == most) {
      return 0;
    }
    add_triangle(d, next);
    if (!outline(d) || d->inner_count > wish->most_inner || has_fixed(d)) {
      return 0;
    }
  }
}

/* The first of the points that has a star, planned in *d; 0: none. */
static int plan_first(disc *d, orb_match *match, int32_t vertex, const int32_t *triangles, int count,
                      const double (*points)[3], int point_count, const orb_star_wish *wish) {
  disc start = {.match = match, .p = vertex, .rough = wish->goal == ORB_STAR_NOT_WORSE};
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
