/* Untwisting the limbs of the best map.
 *
 * In: a run (engine/run.h) and its best map. Out: the same, with a better best map if untwisting helped. Read in this
 * order:
 *
 *   rotations.h  how a map rotates the surroundings of each vertex in space
 *   patch.h      a part of the fixed shape, and rings of vertices around it
 *   limb.h       rings around a limb, and rotations along them
 *   bands.h      the rotation of the map from ring to ring
 *   twist.h      finds the twisted limbs, and undoes a twist
 *   untwist.h    applies that to the best map
 */
#ifndef ORB_ALIGN_MAP_TWIST_UNTWIST_H
#define ORB_ALIGN_MAP_TWIST_UNTWIST_H

#include "align/map/engine/run.h"

/* Untwists the limbs of the best map: all at once, by steps, or one by one. The result replaces the
 * best map if it is better. Does nothing if more than this share of the area is kept halfway through the morph. */
ORB_MUST_CHECK orb_status orb_map_untwist(orb_map_run *run, double most_kept);

#endif
