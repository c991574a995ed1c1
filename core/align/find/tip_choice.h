/* Which tip maps are worth a trial. */
#ifndef ORB_ALIGN_FIND_TIP_CHOICE_H
#define ORB_ALIGN_FIND_TIP_CHOICE_H

#include "align/find/tip_maps.h"

/* Of these maps, best first, at most `most` that are worth a trial: by turns from each way round in space that the tips
 * can be fitted, those whose tips fit best first, none that a mirror image would fit clearly better. chosen: indices.
 */
ORB_MUST_CHECK orb_status orb_tip_maps_choose(orb_context *ctx, const orb_mesh *const meshes[2], const orb_tips tips[2],
                                              const orb_tip_map *maps, int32_t count, int32_t most, int32_t *chosen,
                                              int32_t *chosen_count);

/* Where tips are, seen from the middle of the surface by area: tips->count points. */
void orb_tips_from_middle(const orb_mesh *mesh, const orb_tips *tips, double (*out)[3]);

#endif
