/* Tip maps by rotations in space. */
#ifndef ORB_ALIGN_FIND_TIP_TURNS_H
#define ORB_ALIGN_FIND_TIP_TURNS_H

#include "align/find/tip_maps.h"

/* The maps that come of turning one shape onto the other in space, best first, see tip_turns.c. They are few, and all
 * worth a trial. */
ORB_MUST_CHECK orb_status orb_tip_maps_by_turns(orb_context *ctx, const orb_mesh *const meshes[2],
                                                const orb_tips tips[2], orb_tip_map out[ORB_TIP_TURNS], int32_t *count);

#endif
