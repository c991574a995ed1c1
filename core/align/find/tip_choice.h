/* Which tip maps are worth a trial. */
#ifndef ORB_ALIGN_FIND_TIP_CHOICE_H
#define ORB_ALIGN_FIND_TIP_CHOICE_H

#include "align/find/tip_maps.h"

/* Chooses at most `most` of these maps, best first. The rotations that fit the tips in space are grouped, and the
 * groups take turns, each with its map whose tips fit best. Leaves out maps that a mirror image fits clearly better.
 * chosen: indices. */
ORB_MUST_CHECK orb_status orb_tip_maps_choose(orb_context *ctx, const orb_mesh *const meshes[2], const orb_tips tips[2],
                                              const orb_tip_map *maps, int32_t count, int32_t most, int32_t *chosen,
                                              int32_t *chosen_count);

/* The positions of tips relative to the centre of area of the surface: tips->count vectors. */
void orb_tips_from_middle(const orb_mesh *mesh, const orb_tips *tips, double (*out)[3]);

#endif
