/* Undoing a round of collapses and placing its vertices. */
#ifndef ORB_EMBED_NEWTON_PLACE_H
#define ORB_EMBED_NEWTON_PLACE_H

#include "embed/newton/refiner.h"

/* Undoes the collapses of one round (or what is left of it) and places its vertices. blend: of shapes towards
 * equilateral. */
ORB_MUST_CHECK orb_status orb_refiner_undo_round(orb_context *ctx, orb_refiner *refiner, double blend);

/* Undoes rounds until at least `vertices` live, on the surface only: the caller sets the points of the new vertices. */
ORB_MUST_CHECK orb_status orb_refiner_skip(orb_context *ctx, orb_refiner *refiner, int32_t vertices);

#endif
