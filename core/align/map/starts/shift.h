/* Moves landmarks of a map to their partners nearby, and what lies around them with them. */
#ifndef ORB_ALIGN_MAP_STARTS_SHIFT_H
#define ORB_ALIGN_MAP_STARTS_SHIFT_H

#include "align/map/engine/run.h"

/* Sets run->start to the map as given, with the landmarks at their partners and their surroundings shifted along. Few
 * triangles flip where landmarks were near their partners. O(n · landmarks + n log n). */
ORB_MUST_CHECK orb_status orb_map_shift(orb_map_run *run);

#endif
