/* The start in which all pairs meet, by a landmark walk. */
#ifndef ORB_ALIGN_MAP_STARTS_LANDMARK_WALK_H
#define ORB_ALIGN_MAP_STARTS_LANDMARK_WALK_H

#include "align/map/engine/run.h"

/* compose_walk.c. The landmarks, and guesses from them. */
ORB_MUST_CHECK orb_status orb_map_pairs_create(orb_map_run *run);

/* Embeds both shapes anew so that all pairs meet, and with them at most so many samples of the spatial targets, or of
 * what is sound of a start. run->start is what comes of it, and if run->both is set the fixed shape's sphere is
 * replaced, else the map is carried to it. *stuck: nothing came of it, and all is as it was. */
ORB_MUST_CHECK orb_status orb_map_landmark_walk(orb_map_run *run, int32_t samples, int *stuck);

#endif
