/* The stages of the method `pin`. */
#ifndef ORB_ALIGN_PIN_H
#define ORB_ALIGN_PIN_H

#include "align/sheet.h"

/* What a pinning may use up. */
typedef struct orb_pin_room {
  double growth; /* of a sheet, see orb_pin_limit() */
  int64_t work;  /* visits of nodes and vertices that are left; where it is used up the landmarks count as not met */
} orb_pin_room;

/* Embeds the shapes anew, together: on a coarse level landmarks walk to their spherical means, are pinned, and the
 * level is refined to the full meshes. *stuck: 0 where all arrived and every embedding is certified; else 1 and the
 * sheets are unchanged. preset: of the embedding's effort. coarse: least number of vertices of the level. */
ORB_MUST_CHECK orb_status orb_pin_walk(orb_context *ctx, orb_sheet *sheets, int32_t shape_count,
                                       const int32_t *landmarks, int32_t count, orb_preset preset, int32_t coarse,
                                       int *stuck);

/* Embeds one shape so that its landmarks lie at the targets (3 a landmark, distinct, unit): traces the edges of a
 * triangulation of the targets as paths on the shape's sphere, splitting edges as needed, embeds each patch in its
 * spherical triangle, and relaxes. *held: 0 where rounding broke it or the room does not suffice, and the sheet is
 * unchanged. */
ORB_MUST_CHECK orb_status orb_pin_patches(orb_context *ctx, orb_sheet *sheet, const int32_t *landmarks, int32_t count,
                                          const double *targets, orb_preset preset, orb_pin_room *room, int *held);

/* The same for all shapes at once, on a base that suits them all and with targets of its own; count ≥ 4. */
ORB_MUST_CHECK orb_status orb_pin_joint(orb_context *ctx, orb_sheet *sheets, int32_t shape_count,
                                        const int32_t *landmarks, int32_t count, orb_preset preset, orb_pin_room *room,
                                        int *held);

/* Most triangles of a sheet that may grow by this share of its own number; small ones by more. */
int32_t orb_pin_limit(const orb_sheet *sheet, double growth);

/* Sweeps at full resolution with the landmarks pinned, certified; where the sweeps do not lead to a certified
 * embedding the points stay as they were. */
ORB_MUST_CHECK orb_status orb_pin_relax(orb_context *ctx, orb_sheet *sheet, const int32_t *landmarks, int32_t count,
                                        orb_preset preset, int32_t sweeps);

/* Sweeps as above, and removes what splits made and the landmarks no longer need, by turns. */
ORB_MUST_CHECK orb_status orb_pin_slim(orb_context *ctx, orb_sheet *sheet, const int32_t *landmarks, int32_t count,
                                       orb_preset preset, int64_t *work);

#endif
