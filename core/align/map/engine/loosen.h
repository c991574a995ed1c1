/* Rounds that allow flips for a while, and clear them. */
#ifndef ORB_ALIGN_MAP_ENGINE_LOOSEN_H
#define ORB_ALIGN_MAP_ENGINE_LOOSEN_H

#include "align/map/engine/run.h"

/* Frees vertices that barriers have locked in: allows flips for a while, against a barrier of this strength, and clears
 * them. Keeps the result only if no flip is left and its energy is lower. */
ORB_MUST_CHECK orb_status orb_map_loosen(orb_map_run *run, orb_map_level *level, double barrier, int soft_sweeps,
                                         int hard_sweeps);

/* Draws a level without flips to its spatial targets, less strongly from round to round. */
ORB_MUST_CHECK orb_status orb_map_draw(orb_map_run *run, orb_map_level *level, const int32_t *to_mesh);

#endif
