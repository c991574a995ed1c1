/* The method `newton` (docs/method.md): decimation with carried areas, undo, level sweeps of a damped Newton method. */
#ifndef ORB_EMBED_NEWTON_NEWTON_H
#define ORB_EMBED_NEWTON_NEWTON_H

#include "orbmorph/embed.h"

/* Fills points (3 per vertex of the mesh) and the timings of simplify and embed. The points are not certified yet. */
ORB_MUST_CHECK orb_status orb_newton_run(orb_context *ctx, const orb_mesh *mesh, const orb_embed_options *options,
                                         double *points, orb_embed_timings *timings);

/* The same with the energy of angles, whatever options->energy_weight says: triangles nearly keep their shapes, and
 * limbs become small. Alignment takes it for the even sphere. An embedding that stretches a surface about as much in
 * every direction hardly bends the straight edges of another mesh. The points are not certified yet. */
ORB_MUST_CHECK orb_status orb_newton_run_angles(orb_context *ctx, const orb_mesh *mesh,
                                                const orb_embed_options *options, double *points);

#endif
