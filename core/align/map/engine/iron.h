/* Ironing: sets crumpled parts of a map anew, each by itself. */
#ifndef ORB_ALIGN_MAP_ENGINE_IRON_H
#define ORB_ALIGN_MAP_ENGINE_IRON_H

#include "align/map/engine/run.h"

/* After the flips of a folded start are cleared, parts remain whose triangles hold each other in a crumple, while the
 * map around them is right. Sets such parts of a level without flips anew (unfold.h), sweeps them smooth while all
 * other vertices stay, and keeps each part whose energy has fallen. Runs some rounds, each over other parts. A round
 * costs about as much as one sweep of the level, and the sweeps of its parts. */
ORB_MUST_CHECK orb_status orb_map_iron(orb_map_run *run, orb_map_level *level);

#endif
