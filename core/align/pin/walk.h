/* The landmark walk: landmarks walk to their common targets on a coarse level. */
#ifndef ORB_ALIGN_PIN_WALK_H
#define ORB_ALIGN_PIN_WALK_H

#include "align/sheet/sheet.h"

/* Embeds the shapes anew, together: on a coarse level the landmarks walk to their spherical means and are pinned there,
 * and the level is refined to the full meshes. *stuck 0: all arrived and every embedding is certified; 1: the sheets
 * are unchanged. preset: of the embeddings. coarse: least vertices of the level. */
ORB_MUST_CHECK orb_status orb_pin_walk(orb_context *ctx, orb_sheet *sheets, int32_t shape_count,
                                       const int32_t *landmarks, int32_t count, orb_preset preset, int32_t coarse,
                                       int *stuck);

#endif
