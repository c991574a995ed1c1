/* Levels that are nearly a map: few flips, which can be cleared. */
#ifndef ORB_ALIGN_MAP_ENGINE_NEAR_H
#define ORB_ALIGN_MAP_ENGINE_NEAR_H

#include "align/map/engine/run.h"

/* compose_near.c. Whether a level with so many flips is nearly a map. */
int orb_map_is_near(const orb_map_level *level, int32_t flips);

/* Lets held vertices near the flips go, clears these, and holds them again at their points. *flips: that are left, and
 * vertices that did not come home. */
ORB_MUST_CHECK orb_status orb_map_release(orb_map_run *run, orb_map_level *level, const int32_t *to_mesh,
                                          int32_t *flips);

/* Notes where the vertices away from the flips are: run->sound, run->goal_place. */
ORB_MUST_CHECK orb_status orb_map_keep_sound(orb_map_run *run, const orb_map_level *level, const int32_t *to_mesh);

#endif
