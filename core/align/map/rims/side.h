/* One of two shapes whose holes are matched. */
#ifndef ORB_ALIGN_MAP_RIMS_SIDE_H
#define ORB_ALIGN_MAP_RIMS_SIDE_H

#include "mesh/holes.h"
#include "orbmorph/alignment.h"
#include "orbmorph/locate.h"

typedef struct orb_rim_side {
  const orb_aligned_shape *shape; /* borrowed */
  orb_hole_list holes;
  orb_locator *locator;
  double diagonal;
  double *image; /* of each vertex of the rims, in the order of holes.half_edges: where it lies on the other shape */
} orb_rim_side;

/* Both sides; the images are by the spheres. Free them in any case. */
ORB_MUST_CHECK orb_status orb_rim_sides_create(orb_context *ctx, const orb_aligned_shape *first,
                                               const orb_aligned_shape *second, orb_rim_side sides[2]);
void orb_rim_sides_free(orb_context *ctx, orb_rim_side sides[2]);

/* The point of a rim that is nearest to p: as a share of the rim's length from its first vertex. *distance: from p.
 * O(edges). */
double orb_rim_nearest(const orb_rim_side *side, const orb_hole *hole, const double p[3], double *distance);

#endif
