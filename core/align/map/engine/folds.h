/* Folds: connected parts of a level in which untangling leaves flips. */
#ifndef ORB_ALIGN_MAP_ENGINE_FOLDS_H
#define ORB_ALIGN_MAP_ENGINE_FOLDS_H

#include "align/map/engine/level.h"

/* Puts the vertices of every part that has moved and still has flips back to where they were. A part is a set of moved
 * vertices that edges connect. before: x of all vertices, 3 each, before untangling. Only x changes; the caller locates
 * the vertices again. *flips: those of the whole level afterwards. O(n). */
ORB_MUST_CHECK orb_status orb_map_level_restore_folds(orb_context *ctx, orb_map_level *level, const double *before,
                                                      int32_t *flips);

#endif
