/* A match: a net with its places on every shape, and the proved distance between the net's surfaces and the shapes.
 *
 * The bound. Overlay the net with shape s on the sphere (in thought). Send each vertex of the overlay to a point of the
 * shape and to a point of the net's surface: a vertex of the shape to itself and to the nearest point of the net
 * triangle that holds it; a net vertex to its place and itself; a crossing of a net edge with an edge of the shape to
 * the two nearest points of these two segments. Each cell of the overlay lies in one triangle of the shape and in one
 * of the net, so its linear extension stays in both (they are convex); both maps are continuous and of degree 1, so
 * they cover both surfaces; and the distance of matched points is greatest at vertices. The greatest of the matched
 * distances therefore bounds the Hausdorff (even the Fréchet) distance, both ways. Only the combinatorics of the
 * overlay enter, and those are decided exactly. Nothing has to be stored but which vertices lie in which triangle. */
#ifndef ORB_REMESH_MATCH_H
#define ORB_REMESH_MATCH_H

#include "remesh/methods.h"
#include "remesh/trace.h"

typedef struct orb_match {
  const orb_remesh_job *job;
  orb_net net;
  int32_t shape_count, capacity; /* capacity in net vertices of the arrays below */
  orb_sphere_view *view;         /* a shape */
  double **position;             /* a shape: its vertices, divided by its diagonal */
  double *at;                    /* net vertex major: 3 for each shape, its positions, likewise scaled */
  orb_spot *spot;                /* net vertex major: one for each shape */
  unsigned char *fixed;          /* a net vertex: a landmark, not to be removed */
  /* Items: the vertices of all shapes, shape after shape. Each is in the list of a net vertex or of a triangle. */
  int32_t *item_begin; /* shape_count + 1 */
  int32_t *item_next;
  int32_t *item_shape;
  int32_t *vertex_items, *triangle_items; /* heads, −1: none */
} orb_match;

/* Starts from the shape with the most triangles and makes every other shape's vertices vertices too. */
ORB_MUST_CHECK orb_status orb_match_create(orb_context *ctx, const orb_remesh_job *job, orb_match *match);
/* Starts from a given certified triangulation. */
ORB_MUST_CHECK orb_status orb_match_create_on(orb_context *ctx, const orb_remesh_job *job, const orb_net *net,
                                              orb_match *match);
void orb_match_free(orb_context *ctx, orb_match *match);

static inline const double *orb_match_at(const orb_match *match, int32_t v, int32_t s) {
  return match->at + 3 * ((int64_t)v * match->shape_count + s);
}

/* Position of an item on the sphere and, scaled, in space. */
const double *orb_match_item_point(const orb_match *match, int32_t item);
const double *orb_match_item_position(const orb_match *match, int32_t item);

/* Where an edge strays most from a shape. */
typedef struct orb_stray {
  double distance2; /* relative to the diagonal, squared */
  int32_t shape, h; /* the crossing: half-edge or vertex of the shape */
  int at_vertex;
} orb_stray;

/* The greatest matched distance along the net edge v w, over all shapes; stops early once beyond limit2. worst may be
 * NULL. */
double orb_match_edge2(const orb_match *match, int32_t v, int32_t w, double limit2, orb_stray *worst);
double orb_match_edge_of_shape2(const orb_match *match, int32_t s, int32_t v, int32_t w, double limit2,
                                orb_stray *worst);

/* Squared distance of an item to the net triangle a b c. */
double orb_match_item2(const orb_match *match, int32_t item, int32_t a, int32_t b, int32_t c);

/* The proved bound for each shape, in its units: over all edges and items; parallel. */
ORB_MUST_CHECK orb_status orb_match_bounds(orb_context *ctx, const orb_match *match, double *bound);

/* Makes room for more net vertices. */
ORB_MUST_CHECK orb_status orb_match_reserve(orb_context *ctx, orb_match *match, int64_t more);

/* Splits net edge h at p if all four triangles stay positive; the new vertex, or −1. Needs room for one. Items of the
 * two triangles are handed on. */
int32_t orb_match_split(orb_match *match, int32_t h, const double p[3]);

/* Puts the items of a list into the triangles that hold them, by walks from triangle `start`. */
void orb_match_deal(orb_match *match, int32_t list, int32_t start);

/* Splits, or turns, every edge that strays farther than the tolerance (relative, squared), until none does; *strays
 * (may be NULL) counts the edges that strayed at first. */
ORB_MUST_CHECK orb_status orb_match_refine(orb_context *ctx, orb_match *match, double limit2, int64_t *strays);

/* Turns an edge if that keeps the bound and helps the shape of the triangles; whether it did. */
int orb_match_try_turn(orb_match *match, int32_t h, double limit2);
ORB_MUST_CHECK orb_status orb_match_turn_all(orb_context *ctx, orb_match *match, double limit2);

/* Quality of a triangle in space, 0 degenerate to 1 equilateral, the least over all shapes. */
double orb_match_quality(const orb_match *match, int32_t a, int32_t b, int32_t c);

/* Collapses edges while every matched distance stays within the limit (relative, squared) and more than
 * `target` triangles live. strict: also keep triangles from turning over and from becoming slivers in space. */
ORB_MUST_CHECK orb_status orb_match_collapse(orb_context *ctx, orb_match *match, double limit2, int64_t target,
                                             int strict);
int64_t orb_match_live(const orb_match *match);

/* Places, points, triangles and bounds of the live net. */
ORB_MUST_CHECK orb_status orb_match_export(orb_context *ctx, const orb_match *match, orb_supermesh *out);

#endif
