/* The overlay of two spherical triangulations: their exact common refinement. */
#ifndef ORB_REMESH_OVERLAY_BUILD_H
#define ORB_REMESH_OVERLAY_BUILD_H

#include "remesh/overlay/layers.h"

/* Overlays two layers whose view, vertex_count and locator are set. The triangles are those of the exact arrangement;
 * the rounding of crossings may have flipped some, which orb_overlay_repair() repairs. The caller calls
 * orb_overlay_free(), also after an error. */
ORB_MUST_CHECK orb_status orb_overlay_build(orb_context *ctx, orb_overlay *overlay);
/* Frees what orb_overlay_build() has filled; views and locators belong to the caller. */
void orb_overlay_free(orb_context *ctx, orb_overlay *overlay);

#endif
