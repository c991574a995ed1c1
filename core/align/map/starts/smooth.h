/* Smooths the places of a start from spatial targets.
 *
 * The nearest places of a shape that lies near the fixed one are a map except for noise and outliers: neighbours that
 * change places, and parts of a limb that found the limb beside it. Both make folds, which clearing flips cannot always
 * undo. On the sphere, an outlier is far from its neighbours, even where limbs touch in space. */
#ifndef ORB_ALIGN_MAP_STARTS_SMOOTH_H
#define ORB_ALIGN_MAP_STARTS_SMOOTH_H

#include "align/map/engine/run.h"

/* Moves the vertices of a level that are not pinned to where their targets and their neighbours draw them, and locates
 * them there. Targets that face another way (run->doubted) or that most neighbours contradict do not count; those of
 * flipped triangles count less from round to round. to_mesh: as of the level's surface. O(vertices), one thread. */
ORB_MUST_CHECK orb_status orb_map_smooth(orb_map_run *run, orb_map_level *level, const int32_t *to_mesh);

#endif
