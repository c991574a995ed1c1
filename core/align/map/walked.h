/* The quick way to a map: one landmark walk, optimised on a coarse level. */
#ifndef ORB_ALIGN_MAP_WALKED_H
#define ORB_ALIGN_MAP_WALKED_H

#include "align/map/engine/run.h"

/* Walks the pairs together on a level of a few hundred vertices, where nothing is flipped and a map takes milliseconds
 * to optimise, and optimises up to a coarse level (params.walked). *good 1: the energy there is that of shapes that
 * correspond; the map is refined to all vertices and is run->best. 0: the run is as it was. The fixed shape must be
 * allowed to change (run->both). Sets run->hierarchy. */
ORB_MUST_CHECK orb_status orb_map_try_walked(orb_map_run *run, int *good);

#endif
