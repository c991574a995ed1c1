/* Mirror landmarks. */
#ifndef ORB_ALIGN_MAP_STARTS_MIRROR_H
#define ORB_ALIGN_MAP_STARTS_MIRROR_H

#include "align/map/engine/params.h"
#include "orbmorph/mesh.h"

/* Finds mirror landmarks: the mirror images of the landmarks where both shapes are nearly symmetric. landmarks:
 * vertices of either shape, `count` each; images: likewise, room for `count` each; *image_count: the number found. */
ORB_MUST_CHECK orb_status orb_map_mirror_landmarks(orb_context *ctx, const orb_map_params *params,
                                                   const orb_mesh *const meshes[2], const int32_t *const landmarks[2],
                                                   int32_t count, int32_t *const images[2], int32_t *image_count);

#endif
