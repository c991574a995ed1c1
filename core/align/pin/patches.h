/* Landmarks pinned by patches: the surface is cut along traced paths. */
#ifndef ORB_ALIGN_PIN_PATCHES_H
#define ORB_ALIGN_PIN_PATCHES_H

#include "align/pin/paths.h"
#include "align/pin/room.h"

/* Embeds one shape so that its landmarks lie at the targets (3 a landmark, distinct, unit): traces the edges of a
 * triangulation of the targets as paths on the shape's sphere, splitting edges as needed, embeds each patch in its
 * spherical triangle, and relaxes. *held: 0 where rounding broke it or the room does not suffice, and the sheet is
 * unchanged. */
ORB_MUST_CHECK orb_status orb_pin_patches(orb_context *ctx, orb_sheet *sheet, const int32_t *landmarks, int32_t count,
                                          const double *targets, orb_preset preset, orb_pin_room *room, int *held);

/* Embeds a sheet whose paths are those of a base: every patch in its spherical triangle (patches.c). May split edges.
 * *held 0 where rounding broke it; the points are then of no use. */
ORB_MUST_CHECK orb_status orb_patch_embed(orb_context *ctx, orb_sheet *sheet, const orb_sheet *base, int32_t *at,
                                          orb_paths *paths, int64_t *work, int *held);

#endif
