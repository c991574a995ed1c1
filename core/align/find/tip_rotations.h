/* Tip maps by rotations in space. */
#ifndef ORB_ALIGN_FIND_TIP_ROTATIONS_H
#define ORB_ALIGN_FIND_TIP_ROTATIONS_H

#include "align/find/tip_maps.h"

/* The tip maps that follow from rotating one shape onto the other in space, best first; tip_rotations.c describes the
 * method. They are few, and all worth a trial. */
ORB_MUST_CHECK orb_status orb_tip_maps_by_rotation(orb_context *ctx, const orb_mesh *const meshes[2],
                                                   const orb_tips tips[2], orb_tip_map out[ORB_TIP_ROTATIONS],
                                                   int32_t *count);

#endif
