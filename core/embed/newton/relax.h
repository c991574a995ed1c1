/* The scalar step: for placement, and for the vertices that the vector sweeps leave over. */
#ifndef ORB_EMBED_NEWTON_RELAX_H
#define ORB_EMBED_NEWTON_RELAX_H

#include "embed/newton/refiner.h"

/* One damped Newton step of a vertex (numbered as in the surface), accepted only where every triangle stays exactly
 * positive. *gain: by what share the energy of its star fell; *crowding (may be NULL): that energy over twice the
 * star's target area. A pinned vertex stays, with a gain of 0. Uses the star of thread 0. */
ORB_MUST_CHECK orb_status orb_refiner_relax(orb_context *ctx, orb_refiner *refiner, int32_t vertex, double blend,
                                            double *gain, double *crowding);

#endif
