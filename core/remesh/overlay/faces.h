/* The triangles of an overlay. */
#ifndef ORB_REMESH_OVERLAY_FACES_H
#define ORB_REMESH_OVERLAY_FACES_H

#include "remesh/overlay/layers.h"

/* The second step of orb_overlay_build(): fills triangles and parents. */
ORB_MUST_CHECK orb_status orb_overlay_faces(orb_context *ctx, orb_overlay *overlay);

#endif
