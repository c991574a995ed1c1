/* The vertices of an overlay. */
#ifndef ORB_REMESH_OVERLAY_TRACE_H
#define ORB_REMESH_OVERLAY_TRACE_H

#include "remesh/overlay/layers.h"

/* The first step of orb_overlay_build(): fills the layers, points and places. */
ORB_MUST_CHECK orb_status orb_overlay_trace(orb_context *ctx, orb_overlay *overlay);

#endif
