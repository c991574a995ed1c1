/* Starts from the overlay of the shapes. */
#ifndef ORB_REMESH_ADAPTIVE_START_H
#define ORB_REMESH_ADAPTIVE_START_H

#include "remesh/placed/placed_net.h"

/* Estimates how many triangles the overlay of all shapes has, from a sample of their edges. Parallel. */
ORB_MUST_CHECK orb_status orb_adaptive_overlay_size(orb_context *ctx, const orb_remesh_job *job, int64_t *triangles);
/* Makes the placed net from the vertices that are left after thinning each shape alone (thin.h). */
ORB_MUST_CHECK orb_status orb_adaptive_start_from_thinned(orb_context *ctx, const orb_remesh_job *job, double limit2,
                                                          orb_placed_net *placed);
/* Replaces the placed net (may be zeroed) by one on the overlay of the shapes, which is exact, or thinned out within
 * limit2 (relative, squared; 0: not at all). On an error the net stays as it is. */
ORB_MUST_CHECK orb_status orb_adaptive_start_from_overlay(orb_context *ctx, const orb_remesh_job *job, double limit2,
                                                          orb_placed_net *placed);
/* The same with the overlay of shapes that were first reduced one by one within the limit (relative, squared). It is
 * far smaller where the map is twisted. Some edges and items may deviate by more than the limit. */
ORB_MUST_CHECK orb_status orb_adaptive_start_from_reduced(orb_context *ctx, const orb_remesh_job *job, double limit2,
                                                          orb_placed_net *placed);

#endif
