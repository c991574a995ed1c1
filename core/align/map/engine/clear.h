/* Clearing the flips of a level. */
#ifndef ORB_ALIGN_MAP_ENGINE_CLEAR_H
#define ORB_ALIGN_MAP_ENGINE_CLEAR_H

#include "align/map/engine/run.h"

/* Clears flips: sweeps against a barrier that grows from `barrier`, and untangles and unfolds a copy, until that leaves
 * neither flips nor crumples; of ways that leave crumples, the best one counts. doubts: targets of what is unfolded are
 * doubted (run->doubted); they no longer pull once orb_map_set_pull() is called. *flips: those left; if there are any,
 * only the sweeps have changed the level. */
ORB_MUST_CHECK orb_status orb_map_clear_flips(orb_map_run *run, orb_map_level *level, double barrier, int rounds,
                                              int doubts, int32_t *flips);

#endif
