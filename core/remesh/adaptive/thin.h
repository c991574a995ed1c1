/* Thinning: a net without the vertices that the tolerance does not need, by a guess alone. */
#ifndef ORB_REMESH_ADAPTIVE_THIN_H
#define ORB_REMESH_ADAPTIVE_THIN_H

#include "remesh/common/job.h"
#include "sphere/net.h"

/* Makes `net` from shape s alone, thinned, with some vertices dead. Landmarks stay. */
ORB_MUST_CHECK orb_status orb_adaptive_thin_shape(orb_context *ctx, const orb_remesh_job *job, int32_t s, double limit2,
                                                  orb_net *net);
/* Makes `net` from the overlay of all shapes, thinned. */
ORB_MUST_CHECK orb_status orb_adaptive_thin_overlay(orb_context *ctx, const orb_remesh_job *job,
                                                    const orb_supermesh *overlay, double limit2, orb_net *net);

#endif
