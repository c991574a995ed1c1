/* The proved distance between a placed net's surfaces and the shapes.
 *
 * The bound. Overlay the net with shape s on the sphere (a thought experiment). Send each vertex of the overlay to a
 * point of the shape and to a point of the net's surface: a vertex of the shape to itself and to the nearest point of
 * the net triangle that holds it; a net vertex to its place and to itself; a crossing of a net edge with an edge of the
 * shape to the two nearest points of these two segments. Each cell of the overlay lies in one triangle of the shape and
 * in one of the net, so its linear extension stays in both (they are convex); both maps are continuous and of degree 1,
 * so they cover both surfaces; and the distance of matched points is greatest at vertices. The greatest of the matched
 * distances therefore bounds the Hausdorff (even the Fréchet) distance, both ways. The bound depends only on the
 * combinatorics of the overlay, which exact predicates decide, so it suffices to store which vertices lie in which
 * triangle.
 *
 * Distances are relative to the shape's diagonal, and squared where the name ends in 2. */
#ifndef ORB_REMESH_PLACED_BOUND_H
#define ORB_REMESH_PLACED_BOUND_H

#include "remesh/placed/placed_net.h"

/* Where an edge deviates most from a shape. */
typedef struct orb_deviation {
  double distance2;
  int32_t shape, h; /* the shape's half-edge that the edge crosses there, or a half-edge that leaves the vertex */
  int at_vertex;    /* the edge passes a vertex of the shape */
} orb_deviation;
static const orb_deviation ORB_NO_DEVIATION = {0, -1, -1, 0};

/* The greatest matched distance along net edge v w, over all shapes. Stops early once it exceeds limit2, with a value
 * above limit2. *worst (may be NULL) is updated where the edge deviates more than it says. */
double orb_placed_edge2(const orb_placed_net *placed, int32_t v, int32_t w, double limit2, orb_deviation *worst);

/* The same on shape s where only the limit matters: at most limit2 if and only if the greatest distance is; then it
 * may be greater than that distance. Twice as fast. */
double orb_placed_edge_within2(const orb_placed_net *placed, int32_t s, int32_t v, int32_t w, double limit2);
/* The same over all shapes. */
static inline int orb_placed_edge_is_within(const orb_placed_net *placed, int32_t v, int32_t w, double limit2) {
  for (int32_t s = 0; s < placed->shape_count; s++) {
    if (!(orb_placed_edge_within2(placed, s, v, w, limit2) <= limit2)) {
      return 0;
    }
  }
  return 1;
}

/* A guess of the same on shape s that takes no tracing: the height over its chord of the arc of a circle that has the
 * smooth normals at both ends. It tells which edge of many to test first, and bounds nothing. */
static inline double orb_placed_edge_guess2(const orb_placed_net *placed, int32_t s, int32_t v, int32_t w) {
  const double *a = orb_placed_position(placed, v, s), *b = orb_placed_position(placed, w, s);
  const double *m = orb_placed_normal(placed, v, s), *n = orb_placed_normal(placed, w, s);
  double height8 = 0;
  for (int k = 0; k < 3; k++) {
    height8 += (b[k] - a[k]) * (n[k] - m[k]);
  }
  return height8 * height8 / 64;
}

/* The point of the sphere at which net edge v w meets the edge or vertex of the shape. */
void orb_placed_crossing_point(const orb_placed_net *placed, int32_t v, int32_t w, const orb_deviation *at,
                               double out[3]);

/* The distance of an item to net triangle a b c. */
double orb_placed_item2(const orb_placed_net *placed, int32_t item, int32_t a, int32_t b, int32_t c);

/* The proved bound for each shape, in the shape's units: the greatest over all edges and items. Parallel. */
ORB_MUST_CHECK orb_status orb_placed_bounds(orb_context *ctx, const orb_placed_net *placed, double *bound);

#endif
