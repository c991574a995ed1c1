/* Starts of the composed map: a first level, cleared of flips, and refined to all vertices. */
#ifndef ORB_ALIGN_MAP_START_H
#define ORB_ALIGN_MAP_START_H

#include "align/map/engine/run.h"

/* Runs one start on run->hierarchy, towards the spatial targets of the run. Its points become run->best if they are the
 * best so far. A start whose flips cannot be cleared changes nothing, which is not an error. */
ORB_MUST_CHECK orb_status orb_map_run_start(orb_map_run *run, orb_map_start start);

/* The flips of the first level of a start from the spatial targets, before any is cleared. O(vertices). */
ORB_MUST_CHECK orb_status orb_map_start_flips(orb_map_run *run, int32_t *flips);

/* Registers the moving shape through samples of the best map and starts from there, as long as that helps. draws: a
 * pass that does not help draws the best map to its targets. */
ORB_MUST_CHECK orb_status orb_map_run_passes(orb_map_run *run, int draws);

#endif
