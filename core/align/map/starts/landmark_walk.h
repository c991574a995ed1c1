/* The start in which all pairs meet, by a landmark walk. */
#ifndef ORB_ALIGN_MAP_STARTS_LANDMARK_WALK_H
#define ORB_ALIGN_MAP_STARTS_LANDMARK_WALK_H

#include "align/map/engine/run.h"
#include "align/pin/walk.h"

/* Fills run->pairs: the landmarks, then, if `mirrors`, the mirror landmarks. */
ORB_MUST_CHECK orb_status orb_map_pairs_create(orb_map_run *run, int mirrors);

/* Embeds both shapes anew so that all pairs meet, and with them at most `samples` samples of the spatial targets, or of
 * the usable part of a start. Sets run->start to the result. If run->both, also replaces the fixed shape's sphere;
 * else carries the map to it. *stuck: nothing was found, and nothing has changed. */
ORB_MUST_CHECK orb_status orb_map_landmark_walk(orb_map_run *run, int32_t samples, int *stuck);

/* The same for the level of the moving shape on which the pairs meet, and new points of the fixed shape (3 per vertex).
 * Where that gets stuck without samples, only the landmarks walk, on a finer level. The run does not change. The caller
 * frees both. */
ORB_MUST_CHECK orb_status orb_map_walk_level(orb_map_run *run, int32_t samples, orb_walk_level *level, double **fixed,
                                             int *stuck);

#endif
