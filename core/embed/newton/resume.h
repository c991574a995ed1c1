/* A refiner that starts from a given embedding instead of a tetrahedron. */
#ifndef ORB_EMBED_NEWTON_RESUME_H
#define ORB_EMBED_NEWTON_RESUME_H

#include "embed/newton/refiner.h"

/* A refiner at full resolution with these points (3 a vertex, every triangle positive), and a hierarchy that holds no
 * collapses: for sweeps with pins. Destroy the refiner, then the hierarchy. O(n). */
ORB_MUST_CHECK orb_status orb_refiner_resume(orb_context *ctx, const orb_mesh *mesh, const double *points,
                                             const orb_embed_options *options, orb_hierarchy **hierarchy,
                                             orb_refiner **out);

#endif
