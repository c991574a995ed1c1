/* The vertices of an overlay. */
#ifndef ORB_REMESH_OVERLAY_TRACE_H
#define ORB_REMESH_OVERLAY_TRACE_H

#include "remesh/overlay/layers.h"

/* The first step of an overlay of two layers, the exact common refinement of two spherical triangulations: fills the
 * layers, points and places. view, vertex_count and locator of both layers are set. */
ORB_MUST_CHECK orb_status orb_overlay_trace(orb_context *ctx, orb_overlay *overlay);

#endif
