/* Untangling a level on the sphere. */
#ifndef ORB_ALIGN_MAP_ENGINE_UNTANGLE_H
#define ORB_ALIGN_MAP_ENGINE_UNTANGLE_H

#include "align/map/engine/level.h"

/* Marks the vertices of such triangles, and so many rings about them; the others' marks are 0. next: room for as many
 * (compose_untangle.c). */
ORB_MUST_CHECK orb_status orb_map_level_mark_flips(orb_context *ctx, const orb_map_level *level, int rings,
                                                   unsigned char *mark, unsigned char *next);

/* Optimises flipped neighbourhoods on the sphere until no flip is left (compose_untangle.c); *left: how many are;
 * *work: falls by the steps it took. Only x changes, and only near flips. */
ORB_MUST_CHECK orb_status orb_map_level_untangle(orb_context *ctx, orb_map_level *level, int32_t *left, int64_t *work);

#endif
