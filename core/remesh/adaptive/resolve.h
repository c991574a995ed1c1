/* Local overlay around inverted triangles. */
#ifndef ORB_REMESH_ADAPTIVE_RESOLVE_H
#define ORB_REMESH_ADAPTIVE_RESOLVE_H

#include "remesh/placed/placed_net.h"

/* Refines the inverted triangles and those around them to the overlay of the shapes. Edges outside may deviate by more
 * than the limit (relative, squared) afterwards. */
ORB_MUST_CHECK orb_status orb_adaptive_resolve(orb_context *ctx, orb_placed_net *placed, double limit2);

#endif
