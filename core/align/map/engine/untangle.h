/* Untangling a level on the sphere. */
#ifndef ORB_ALIGN_MAP_ENGINE_UNTANGLE_H
#define ORB_ALIGN_MAP_ENGINE_UNTANGLE_H

#include "align/map/engine/level.h"

/* Marks the vertices of flipped triangles and of `rings` rings around them, and clears the other marks. next: room for
 * as many marks. */
ORB_MUST_CHECK orb_status orb_map_level_mark_flips(orb_context *ctx, const orb_map_level *level, int rings,
                                                   unsigned char *mark, unsigned char *next);

/* Marks `rings` more rings around the marked vertices. */
void orb_map_level_grow_marks(const orb_map_level *level, int rings, unsigned char *mark, unsigned char *next);

/* Optimises the neighbourhoods of flips on the sphere until no flip is left. Changes only x, and only near flips.
 * *left: flips that remain; *work falls by the steps taken. */
ORB_MUST_CHECK orb_status orb_map_level_untangle(orb_context *ctx, orb_map_level *level, int32_t *left, int64_t *work);

#endif
