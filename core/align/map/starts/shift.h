/* Moves landmarks of a map to their partners nearby, and what lies around them with them. */
#ifndef ORB_ALIGN_MAP_STARTS_SHIFT_H
#define ORB_ALIGN_MAP_STARTS_SHIFT_H

#include "align/map/engine/run.h"

/* Sets run->start to the best map, with the landmarks moved this share of the way to their partners (1: to their
 * points, exactly), and their surroundings with them. Few triangles flip where the ways are short. O(n · landmarks +
 * n log n). */
ORB_MUST_CHECK orb_status orb_map_shift(orb_map_run *run, double share);
/* The longest way of a landmark from where the best map takes it to its partner, in radii of a ball of the shape's
 * area. */
double orb_map_longest_way(const orb_map_run *run);

#endif
