/* Landmarks pinned by patches, which traced paths cut out of the surface. */
#ifndef ORB_ALIGN_PIN_PATCHES_H
#define ORB_ALIGN_PIN_PATCHES_H

#include "align/pin/paths.h"
#include "align/pin/room.h"

/* Embeds one shape so that its landmarks lie at the targets (3 per landmark, distinct, unit): traces the edges of a
 * triangulation of the targets as paths on the shape's sphere, splitting edges as needed, embeds each patch in its
 * spherical triangle, and relaxes. *held 0: rounding broke the result or the room does not suffice, and the sheet is
 * unchanged. */
ORB_MUST_CHECK orb_status orb_pin_patches(orb_context *ctx, orb_sheet *sheet, const int32_t *landmarks, int32_t count,
                                          const double *targets, orb_preset preset, orb_pin_room *room, int *held);

/* Embeds a sheet that has the paths of a base: every patch in its spherical triangle. May split edges. *held 0:
 * rounding broke the result, and the points are invalid. */
ORB_MUST_CHECK orb_status orb_patch_embed(orb_context *ctx, orb_sheet *sheet, const orb_sheet *base, int32_t *at,
                                          orb_paths *paths, int64_t *work, int *held);

#endif
