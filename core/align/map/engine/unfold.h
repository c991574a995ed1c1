/* Clearing the last flips for certain: vertices around them are collapsed until nothing is flipped, and come back
 * inside their kernels. */
#ifndef ORB_ALIGN_MAP_ENGINE_UNFOLD_H
#define ORB_ALIGN_MAP_ENGINE_UNFOLD_H

#include "align/map/engine/level.h"

/* Moves vertices around flipped triangles so that no triangle of the level is flipped. Pinned vertices stay. Only x
 * changes; the caller locates the vertices again. *left: 0, or the number of flips that remain. In that case nothing
 * has changed: pinned vertices are folded among themselves, or doubles have no room. O(n + size of the folds). */
ORB_MUST_CHECK orb_status orb_map_level_unfold(orb_context *ctx, orb_map_level *level, int32_t *left);

/* Sets the marked vertices of a level without flips anew: collapses them onto what surrounds them, and lets them come
 * back inside their kernels, near the middles of their rings. Vertices beside them make room. Pinned vertices stay.
 * Only x changes, and nothing where doubles have no room. O(n + size of the marked parts). */
ORB_MUST_CHECK orb_status orb_map_level_set_anew(orb_context *ctx, orb_map_level *level, const unsigned char *mark);

#endif
