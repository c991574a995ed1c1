/* One half-edge collapse on the surface, its record, and its exact undo: each O(valence). */
#ifndef ORB_EMBED_NEWTON_COLLAPSE_H
#define ORB_EMBED_NEWTON_COLLAPSE_H

#include "embed/newton/multires.h"

/* Makes room in area_log for a collapse of this valence. */
ORB_MUST_CHECK orb_status orb_collapse_reserve(orb_context *ctx, orb_hierarchy *h, int32_t valence);

/* Collapses the vertex of corner `first` into the vertex next to it. out and areas (valence − 2 floats) take the
 * record; both may be NULL. */
void orb_collapse_apply(orb_corner_table *s, int32_t first, int32_t valence, orb_collapse *out, float *areas);

/* Undo takes back logged collapse `index`, which must be the last that is not undone. Redo applies it again. */
void orb_collapse_undo(orb_hierarchy *h, int32_t index);
void orb_collapse_redo(orb_hierarchy *h, int32_t index);

#endif
