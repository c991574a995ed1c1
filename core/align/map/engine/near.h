/* Levels that are nearly a map: they have few flips, which can be cleared. */
#ifndef ORB_ALIGN_MAP_ENGINE_NEAR_H
#define ORB_ALIGN_MAP_ENGINE_NEAR_H

#include "align/map/engine/run.h"

/* Is a level with this number of flips nearly a map? */
int orb_map_is_near(const orb_map_level *level, int32_t flips);

/* Releases held vertices near the flips, clears the flips, and holds the vertices at their points again. *flips: the
 * remaining flips, and vertices that did not come back. */
ORB_MUST_CHECK orb_status orb_map_release(orb_map_run *run, orb_map_level *level, const int32_t *to_mesh,
                                          int32_t *flips);

/* Stores where the vertices away from the flips are: run->usable, run->target_place. */
ORB_MUST_CHECK orb_status orb_map_keep_usable(orb_map_run *run, const orb_map_level *level, const int32_t *to_mesh);

#endif
