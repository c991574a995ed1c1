/* Snapping a layer to the vertices of the layer below. */
#ifndef ORB_REMESH_OVERLAY_SNAP_H
#define ORB_REMESH_OVERLAY_SNAP_H

#include "remesh/overlay/layers.h"

/* Copies the points of `layer`; a vertex that lies within rounding (1e-9) of one of the layer below gets that one's
 * point, unless that flips a triangle. points: 3 per vertex of the layer, allocated by the caller. *snapped: how many
 * vertices moved. Needs views, vertex_count and the locator of the layer below. */
ORB_MUST_CHECK orb_status orb_overlay_snap(orb_context *ctx, const orb_layer *below, const orb_layer *layer,
                                           double *points, int32_t *snapped);

#endif
