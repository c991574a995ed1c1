/* Untwisting the limbs of the best map. */
#ifndef ORB_ALIGN_MAP_TWIST_UNTWIST_H
#define ORB_ALIGN_MAP_TWIST_UNTWIST_H

#include "align/map/engine/run.h"

/* compose_unwind.c. Twisted limbs of the best map are turned back, whole, by steps, or one by one, and what comes of it
 * takes the best map's place if it is better. Nothing is done where more than so much of the area is left halfway. */
ORB_MUST_CHECK orb_status orb_map_untwist(orb_map_run *run, double most_kept);

#endif
