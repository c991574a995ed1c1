/* The triangles of an overlay. */
#ifndef ORB_REMESH_OVERLAY_FACES_H
#define ORB_REMESH_OVERLAY_FACES_H

#include "remesh/overlay/layers.h"

/* The second step: fills triangles and parents of an overlay whose vertices orb_overlay_trace() has found. They are
 * those of the exact arrangement; the rounding of crossings may have flipped some, which orb_overlay_repair()
 * corrects. */
ORB_MUST_CHECK orb_status orb_overlay_faces(orb_context *ctx, orb_overlay *overlay);

#endif
