/* The convex-hull method: the Delaunay triangulation of all vertices on the sphere. */
#ifndef ORB_REMESH_CONVEX_HULL_H
#define ORB_REMESH_CONVEX_HULL_H

#include "remesh/common/job.h"

ORB_MUST_CHECK orb_status orb_remesh_convex_hull(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out);

#endif
