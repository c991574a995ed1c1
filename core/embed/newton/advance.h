/* From level to level: undoing rounds of collapses, and the sweeps between them. */
#ifndef ORB_EMBED_NEWTON_ADVANCE_H
#define ORB_EMBED_NEWTON_ADVANCE_H

#include "embed/newton/refiner.h"

/* Undoes collapses until at least `vertices` live (or all), sweeping the levels on the way as an embedding does. Pinned
 * vertices stay where they are, bit for bit. */
ORB_MUST_CHECK orb_status orb_refiner_advance(orb_context *ctx, orb_refiner *refiner, int32_t vertices);

/* `sweeps` Gauss–Seidel sweeps over the current level; *gain (may be NULL): by what share the last lowers the energy.
 */
ORB_MUST_CHECK orb_status orb_refiner_sweep(orb_context *ctx, orb_refiner *refiner, int32_t sweeps, double *gain);

#endif
