/* Refinement: brings a placed net within a limit by edge flips, edge splits and new vertices. */
#ifndef ORB_REMESH_PLACED_REFINE_H
#define ORB_REMESH_PLACED_REFINE_H

#include "remesh/placed/placed_net.h"

/* Flips or splits every edge that deviates by more than limit2 (relative, squared), and inserts items that do.
 * *deviating (may be NULL) receives the number of edges that it had to examine: 0 means that all is within the limit.
 * Where the map squeezes a large triangle of a shape to almost nothing on the sphere, splits can creep along it without
 * end. After far more splits than the overlay of all shapes would need, the function sets placed->gave_up and leaves
 * the other edges as they are. */
ORB_MUST_CHECK orb_status orb_placed_refine(orb_context *ctx, orb_placed_net *placed, double limit2,
                                            int64_t *deviating);

#endif
