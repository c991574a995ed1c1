/* Refinement as by Liepa (Filling holes in meshes, 2003), with splits of edges in place of splits of triangles: the
 * longest edge inside goes first, and the Delaunay criterion decides which edges are flipped. */
#include "mesh/patch.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "mesh/edges.h"
#include "numeric/vec3.h"

/* How fast the wanted edge length grows with the distance from the rim: by a fifth of an edge for each edge inwards.
 * Edges of one length everywhere would make rim² / 12 triangles. */
static const double GROWTH = 0.2;
/* An edge this many times as long as wanted is split. Both halves are then nearer to the wanted length. */
static const double LONG = 4.0 / 3;
/* The shortest wanted length, as a share of the mean edge of the rim: vertices that nearly coincide would ask for less.
 */
static const double SHORTEST = 0.1;
/* An edge is flipped if the cotangents of its opposite angles add up to less. Below 0 by the rounding of exact ties. */
static const double DELAUNAY = -1e-6;
static const double COTANGENT = 20; /* of 2.9 degrees */

enum { ROUNDS = 64, FLIP_PASSES = 4 }; /* on a bent surface two edges may take turns: each pass flips fewer, if any */

double orb_patch_cotangent(const double *a, const double *b, const double *c) {
  double u[3], w[3], n[3];
  orb_sub(a, c, u);
  orb_sub(b, c, w);
  orb_cross(u, w, n);
  const double dot = orb_dot(u, w), size = orb_length(n);
  if (!(fabs(dot) < COTANGENT * size)) {
    return dot < 0 ? -COTANGENT : COTANGENT;
  }
  return dot / size;
}

static const double *at(const orb_patch *p, int32_t v) {
  return p->positions + 3 * (size_t)v;
}

static double edge_length(const orb_patch *p, int32_t h) {
  return sqrt(orb_distance2(at(p, p->triangles[h]), at(p, p->triangles[orb_next(h)])));
}

/* The rim in coordinates of its own. Needs no more room than the loop has. */
static void place_rim(orb_patch *p, const double *positions, const int32_t *loop, int32_t count) {
  memset(p->centre, 0, sizeof p->centre);
  for (int32_t i = 0; i < count; i++) {
    for (int k = 0; k < 3; k++) {
      p->centre[k] += positions[3 * (size_t)loop[i] + (size_t)k] / count;
    }
  }
  double most = 0;
  for (int32_t i = 0; i < count; i++) {
    double d[3];
    orb_sub(positions + 3 * (size_t)loop[i], p->centre, d);
    most = fmax(most, orb_length(d));
  }
  p->scale = most > 0 ? most : 1;
  for (int32_t i = 0; i < count; i++) {
    for (int k = 0; k < 3; k++) {
      p->positions[3 * i + k] = (positions[3 * (size_t)loop[i] + (size_t)k] - p->centre[k]) / p->scale;
    }
    p->like[i] = i;
  }
  double mean = 0;
  for (int32_t i = 0; i < count; i++) {
    mean += sqrt(orb_distance2(at(p, i), at(p, i + 1 < count ? i + 1 : 0))) / count;
  }
  for (int32_t i = 0; i < count; i++) {
    const int32_t before = i > 0 ? i - 1 : count - 1, after = i + 1 < count ? i + 1 : 0;
    const double own = sqrt(orb_distance2(at(p, i), at(p, before))) + sqrt(orb_distance2(at(p, i), at(p, after)));
    p->size[i] = fmax(0.5 * own, SHORTEST * mean);
  }
}

orb_status orb_patch_open(orb_context *ctx, const double *positions, const int32_t *loop, int32_t count,
                          const int32_t *cut, int32_t most, double coarser, orb_patch *p) {
  *p = (orb_patch){.rim = count, .vertex_count = count, .triangle_count = count - 2, .growth = coarser * GROWTH};
  p->triangle_room = (most > count ? most : count) + 2 * count; /* a diagonal for each two triangles, at most */
  p->vertex_room = count + p->triangle_room / 2;
  p->positions = ORB_NEW(ctx, double, 3 * (size_t)p->vertex_room);
  p->size = ORB_NEW(ctx, double, p->vertex_room);
  p->like = ORB_NEW(ctx, int32_t, p->vertex_room);
  p->triangles = ORB_NEW(ctx, int32_t, 3 * (size_t)p->triangle_room);
  p->twin = ORB_NEW(ctx, int32_t, 3 * (size_t)p->triangle_room);
  if (!p->positions || !p->size || !p->like || !p->triangles || !p->twin) {
    return ORB_E_NO_MEMORY;
  }
  place_rim(p, positions, loop, count);
  memcpy(p->triangles, cut, 3 * (size_t)p->triangle_count * sizeof *cut);
  orb_edges unused;
  return orb_edges_match(ctx, p->triangles, p->triangle_count, count, p->twin, &unused);
}

void orb_patch_close(orb_context *ctx, orb_patch *p) {
  orb_free(ctx, p->positions);
  orb_free(ctx, p->size);
  orb_free(ctx, p->like);
  orb_free(ctx, p->triangles);
  orb_free(ctx, p->twin);
  *p = (orb_patch){0};
}

static void pair(orb_patch *p, int32_t h, int32_t g) {
  p->twin[h] = g;
  if (g >= 0) {
    p->twin[g] = h;
  }
}

static void set_triangle(orb_patch *p, int32_t t, int32_t a, int32_t b, int32_t c) {
  p->triangles[3 * t] = a;
  p->triangles[3 * t + 1] = b;
  p->triangles[3 * t + 2] = c;
}

/* Splits the edge of h, which is not on the rim, at its middle. Needs room for a vertex and two triangles. */
static void split(orb_patch *p, int32_t h) {
  const int32_t g = p->twin[h], a = p->triangles[h], b = p->triangles[g];
  const int32_t c = p->triangles[orb_prev(h)], d = p->triangles[orb_prev(g)];
  const int32_t bc = p->twin[orb_next(h)], ca = p->twin[orb_prev(h)];
  const int32_t ad = p->twin[orb_next(g)], db = p->twin[orb_prev(g)];
  const int32_t m = p->vertex_count++, s = h / 3, t = g / 3, u = p->triangle_count++, w = p->triangle_count++;
  const double length = edge_length(p, h);
  for (int k = 0; k < 3; k++) {
    p->positions[3 * m + k] = 0.5 * (at(p, a)[k] + at(p, b)[k]);
  }
  p->size[m] = fmin(p->size[a], p->size[b]) + p->growth * 0.5 * length;
  p->like[m] = p->like[p->size[a] <= p->size[b] ? a : b];
  set_triangle(p, s, a, m, c);
  set_triangle(p, u, m, b, c);
  set_triangle(p, t, m, a, d);
  set_triangle(p, w, b, m, d);
  pair(p, 3 * s, 3 * t);
  pair(p, 3 * u, 3 * w);
  pair(p, 3 * s + 1, 3 * u + 2);
  pair(p, 3 * t + 2, 3 * w + 1);
  pair(p, 3 * s + 2, ca);
  pair(p, 3 * u + 1, bc);
  pair(p, 3 * t + 1, ad);
  pair(p, 3 * w + 2, db);
}

/* Whether an edge joins the origin of h to v. Walks around the origin one way and, if the rim ends that walk, the other
 * way. */
static int is_edge(const orb_patch *p, int32_t h, int32_t v) {
  int32_t g = h;
  do {
    if (p->triangles[orb_next(g)] == v || p->triangles[orb_prev(g)] == v) {
      return 1;
    }
    g = p->twin[orb_prev(g)];
  } while (g >= 0 && g != h);
  for (g = g < 0 ? p->twin[h] : -1; g >= 0; g = p->twin[orb_next(g)]) {
    if (p->triangles[g] == v || p->triangles[orb_prev(g)] == v) {
      return 1;
    }
  }
  return 0;
}

/* Flips the edge of h where that makes it Delaunay, and makes no edge twice and none between vertices of the rim. */
static int flip(orb_patch *p, int32_t h) {
  const int32_t g = p->twin[h];
  if (g < 0) {
    return 0;
  }
  const int32_t a = p->triangles[h], b = p->triangles[g];
  const int32_t c = p->triangles[orb_prev(h)], d = p->triangles[orb_prev(g)];
  const double sum =
      orb_patch_cotangent(at(p, a), at(p, b), at(p, c)) + orb_patch_cotangent(at(p, a), at(p, b), at(p, d));
  if (!(sum < DELAUNAY) || c == d || (c < p->rim && d < p->rim) || is_edge(p, orb_prev(h), d)) {
    return 0;
  }
  const int32_t bc = p->twin[orb_next(h)], ca = p->twin[orb_prev(h)];
  const int32_t ad = p->twin[orb_next(g)], db = p->twin[orb_prev(g)];
  const int32_t s = h / 3, t = g / 3;
  set_triangle(p, s, c, a, d);
  set_triangle(p, t, d, b, c);
  pair(p, 3 * s + 2, 3 * t + 2);
  pair(p, 3 * s, ca);
  pair(p, 3 * s + 1, ad);
  pair(p, 3 * t, db);
  pair(p, 3 * t + 1, bc);
  return 1;
}

static void flip_all(orb_patch *p) {
  int64_t flips = 1;
  for (int pass = 0; pass < FLIP_PASSES && flips > 0; pass++) {
    flips = 0;
    for (int32_t h = 0; h < 3 * p->triangle_count; h++) {
      flips += h < p->twin[h] && flip(p, h);
    }
  }
}

/* Lets no wanted length exceed that of a neighbour by more than the growth. */
static void grade(orb_patch *p) {
  for (int32_t h = 0; h < 3 * p->triangle_count; h++) {
    const int32_t a = p->triangles[h], b = p->triangles[orb_next(h)];
    const double growth = p->growth * edge_length(p, h);
    p->size[a] = fmin(p->size[a], p->size[b] + growth);
    p->size[b] = fmin(p->size[b], p->size[a] + growth);
  }
}

/* Whether h is the longest edge inside of its triangle; of equal ones, the last. */
static int is_longest(const orb_patch *p, int32_t h) {
  const double length = edge_length(p, h);
  for (int32_t g = orb_next(h); g != h; g = orb_next(g)) {
    const double other = p->twin[g] < 0 ? 0 : edge_length(p, g);
    if (other > length || (other == length && g > h && p->twin[g] > p->twin[h])) {
      return 0;
    }
  }
  return 1;
}

orb_status orb_patch_refine(orb_context *ctx, orb_patch *p) {
  const int32_t most = p->triangle_room - 2 * p->rim;
  int64_t splits = 1;
  for (int round = 0; round < ROUNDS && splits > 0; round++) {
    const int32_t half_edges = 3 * p->triangle_count;
    splits = 0;
    flip_all(p);
    grade(p);
    for (int32_t h = 0; h < half_edges && p->triangle_count + 2 <= most; h++) {
      const int32_t g = p->twin[h], a = p->triangles[h], b = p->triangles[orb_next(h)];
      if (g > h && edge_length(p, h) > LONG * 0.5 * (p->size[a] + p->size[b]) && is_longest(p, h) && is_longest(p, g)) {
        split(p, h);
        splits++;
      }
    }
    ORB_TRY(orb_context_check(ctx));
  }
  for (int32_t h = 0; h < 3 * p->triangle_count; h++) {
    if (p->twin[h] > h && p->triangles[h] < p->rim && p->triangles[orb_next(h)] < p->rim) {
      split(p, h);
    }
  }
  flip_all(p);
  return orb_context_check(ctx);
}
