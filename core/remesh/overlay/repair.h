/* Repair of an overlay after rounding. */
#ifndef ORB_REMESH_OVERLAY_REPAIR_H
#define ORB_REMESH_OVERLAY_REPAIR_H

#include "remesh/overlay/layers.h"

/* Makes all triangles of a built overlay positive: by untangling, and where vertices lie too close together for that,
 * by merging them. ORB_E_NOT_CERTIFIED if neither suffices. */
ORB_MUST_CHECK orb_status orb_overlay_repair(orb_context *ctx, orb_overlay *overlay);

#endif
