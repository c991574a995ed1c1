/* The map of a decimated copy, refined to all vertices of the shape. */
#ifndef ORB_ALIGN_MAP_LIFTED_H
#define ORB_ALIGN_MAP_LIFTED_H

#include "align/map/engine/run.h"

/* Starts at the level of the moving shape that has a map, and takes ownership of its hierarchy. The vertices of that
 * level are held near where they are, unless the copy lets go. The result becomes run->best. If flips of the level
 * cannot be cleared, run->best_energy stays as it is. */
ORB_MUST_CHECK orb_status orb_map_lift(orb_map_run *run, const orb_map_level_map *copy);

#endif
