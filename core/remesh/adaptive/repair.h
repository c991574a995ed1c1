/* Repair of inverted triangles by single steps. */
#ifndef ORB_REMESH_ADAPTIVE_REPAIR_H
#define ORB_REMESH_ADAPTIVE_REPAIR_H

#include "remesh/placed/placed_net.h"

/* Repairs inverted triangles within the limit (relative, squared), as many as it can. Which ones count:
 * orb_placed_is_inverted(). */
ORB_MUST_CHECK orb_status orb_adaptive_repair(orb_context *ctx, orb_placed_net *placed, double limit2);

#endif
