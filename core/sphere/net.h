/* A net: a spherical triangulation that can be edited. Every operation keeps it closed and of genus zero. Operations
 * that would leave a triangle that is not strictly positive, by the exact orientation, are refused and change nothing,
 * unless their comment leaves that test to the caller. */
#ifndef ORB_SPHERE_NET_H
#define ORB_SPHERE_NET_H

#include "numeric/vec3.h"
#include "orbmorph/mesh.h"
#include "sphere/walk.h"

typedef struct orb_net {
  int32_t vertex_count, vertex_capacity, triangle_count, triangle_capacity;
  double *points;     /* 3 per vertex */
  int32_t *triangles; /* 3 per triangle; first corner −1: dead */
  int32_t *twin;      /* per half-edge */
  int32_t *out;       /* per vertex: a half-edge that leaves it; −1: dead */
} orb_net;

/* Copies a certified triangulation, with room for vertex_capacity vertices. twin: its half-edge pairing, or NULL. */
ORB_MUST_CHECK orb_status orb_net_init(orb_context *ctx, orb_net *net, const double *points, int32_t vertex_count,
                                       const int32_t *triangles, int32_t triangle_count, const int32_t *twin,
                                       int64_t vertex_capacity);
void orb_net_free(orb_context *ctx, orb_net *net);

/* Makes room for `more` further vertices. */
ORB_MUST_CHECK orb_status orb_net_reserve(orb_context *ctx, orb_net *net, int64_t more);

orb_sphere_view orb_net_view(const orb_net *net);
static inline const double *orb_net_point(const orb_net *net, int32_t v) {
  return net->points + 3 * (int64_t)v;
}

/* Makes p a vertex by splitting the edge or triangle that holds it, and returns its number, the former vertex_count; or
 * returns the vertex that p coincides with. Needs room for one vertex. *triangle: in, where the walk starts; out, a
 * triangle at p. */
int32_t orb_net_insert(orb_net *net, const double p[3], int32_t *triangle);

/* Splits the edge of h at p if all four new triangles are positive. Returns the new vertex, or −1. Two of the four keep
 * the numbers of the two old triangles. Needs room for one vertex. */
int32_t orb_net_split_edge(orb_net *net, int32_t h, const double p[3]);

/* Whether the triangle is exactly positive, and clearly so: its height is more than a millionth of its longest side.
 * Points that lie on one arc up to rounding would otherwise make needles that no later step can remove. */
int orb_net_is_clearly_positive(const orb_net *net, int32_t a, int32_t b, int32_t c);
/* The same, with a quick answer where the determinant is above four millionths: sides are no longer than 2, and
 * rounding is far smaller. */
static inline int orb_net_clearly_positive(const orb_net *net, int32_t a, int32_t b, int32_t c) {
  return orb_det(orb_net_point(net, a), orb_net_point(net, b), orb_net_point(net, c)) > 4.1e-6 ||
         orb_net_is_clearly_positive(net, a, b, c);
}

/* Whether the edge of h may be flipped: the new edge exists nowhere else and both new triangles are clearly positive.
 */
int orb_net_can_flip(const orb_net *net, int32_t h);

/* Flips the edge of h = a→b: triangles (a,b,c) and (b,a,d) become (c,d,b) and (d,c,a), with the same two numbers; h is
 * then c→d. Ask orb_net_can_flip() first. */
void orb_net_flip(orb_net *net, int32_t h);

/* Whether the ends of h have exactly two neighbours in common, so that a collapse keeps a simple closed surface. */
int orb_net_can_collapse(const orb_net *net, int32_t h);

/* Moves u onto v, h = u→v, and drops the two triangles between them. The caller tests that the others stay positive. */
void orb_net_collapse(orb_net *net, int32_t h);

/* The half-edge from v to w, or −1. O(valence). */
int32_t orb_net_edge(const orb_net *net, int32_t v, int32_t w);
int orb_net_adjacent(const orb_net *net, int32_t a, int32_t b);

/* The most sides of a hole to fill and of a star: the sizes of arrays on the stack. */
enum { ORB_FILL_MOST = 12, ORB_STAR_MOST = 20 };
/* Removes the origin of h, which has n ≤ ORB_FILL_MOST neighbours, and fills the hole with n − 2 triangles over its
 * ring: corner i is the i-th neighbour counter-clockwise from the end of h. They get the numbers of the first n − 2
 * triangles around the vertex, counter-clockwise from that of h. The caller tests that they are positive. */
void orb_net_fill(orb_net *net, int32_t h, int n, int (*triangles)[3]);

/* Replaces a disc of `count` triangles by the star of vertex p over its boundary: `edges` are the n half-edges of the
 * disc's triangles along it, counter-clockwise; `inner` the vertices inside, n = count + 2 − 2 · inner_count. p is a
 * vertex inside or a new one, number vertex_count, for which there must be room; the other inner ones die. The caller
 * tests that the triangles are positive. Returns one of them. */
int32_t orb_net_star(orb_net *net, const int32_t *triangles, int count, const int32_t *edges, int n,
                     const int32_t *inner, int inner_count, int32_t p);

/* Moves a vertex if every triangle around it stays positive. Returns whether it did. */
int orb_net_move(orb_net *net, int32_t v, const double p[3]);

#endif
