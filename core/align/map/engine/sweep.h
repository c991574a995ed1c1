/* Sweeps of a level. */
#ifndef ORB_ALIGN_MAP_ENGINE_SWEEP_H
#define ORB_ALIGN_MAP_ENGINE_SWEEP_H

#include "align/map/engine/packed.h"

/* Runs at most `count` sweeps of damped Newton steps, part by part and colour by colour, over the vertices of a level
 * that are not pinned, until at most `enough` vertices do not wait. The level's places are on the packed surface. *work
 * falls by the number of steps. */
ORB_MUST_CHECK orb_status orb_map_level_sweeps(orb_context *ctx, orb_map_level *level, const orb_map_packed *packed,
                                               const orb_map_rules *rules, int count, int32_t enough, int64_t *work);

#endif
