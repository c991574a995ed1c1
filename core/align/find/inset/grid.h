/* What lies near the nodes of a grid over a shape. A place on the shape costs a few operations by the grid, and a
 * search in its triangles otherwise. */
#ifndef ORB_ALIGN_FIND_INSET_GRID_H
#define ORB_ALIGN_FIND_INSET_GRID_H

#include "align/find/params.h"
#include "orbmorph/mesh.h"

enum { ORB_INSET_NUMBERS = 7 }; /* a node: its distance from the shape, the nearest place, and the normal there */

/* Nodes over the box of the shape and half a step around it, ORB_FIND_INSET_NODES along its longest side. */
typedef struct orb_inset_grid {
  double low[3], step;
  int32_t count[3];
  float *node;
} orb_inset_grid;

static inline const float *orb_inset_node(const orb_inset_grid *g, int32_t x, int32_t y, int32_t z) {
  const size_t row = (size_t)y + (size_t)g->count[1] * (size_t)z;
  return g->node + ORB_INSET_NUMBERS * ((size_t)x + (size_t)g->count[0] * row);
}

/* The nearest place of a mesh to p, and the unit normal of its triangle. Returns the distance. near: a place that may
 * be near, whose triangle is −1 if none is known; afterwards the nearest place. The nearer it is, the less time it
 * takes. */
double orb_inset_nearest(const orb_mesh *mesh, const orb_nearest *tree, const double p[3], orb_place *near,
                         double at[3], double normal[3]);

/* tree: of the mesh. Free `out` in any case. O(nodes · log n). */
ORB_MUST_CHECK orb_status orb_inset_grid_create(orb_context *ctx, const orb_mesh *mesh, const orb_nearest *tree,
                                                orb_inset_grid *out);
void orb_inset_grid_free(orb_context *ctx, orb_inset_grid *grid);

/* The foot of p on the plane of the place that is nearest to p's node, and the normal there. Returns the distance, or
 * INFINITY if p is outside of the grid. */
double orb_inset_grid_foot(const orb_inset_grid *grid, const double p[3], double at[3], double normal[3]);

#endif
