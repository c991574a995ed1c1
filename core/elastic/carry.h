/* A pose of a coarse mesh, for points beside it. */
#ifndef ORB_ELASTIC_CARRY_H
#define ORB_ELASTIC_CARRY_H

#include "elastic/pose.h"

/* Carries a pose of a coarse mesh to points beside it: each point moves with the corners of its nearest triangle.
 * points: 3 each. out->rotation may be NULL. O(count log n), on all threads. */
ORB_MUST_CHECK orb_status orb_elastic_carry(orb_context *ctx, const orb_mesh *coarse, const orb_elastic_pose *pose,
                                            const double *points, int32_t count, orb_elastic_pose *out);

#endif
