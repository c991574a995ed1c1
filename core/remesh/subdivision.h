/* The subdivision method: a quadtree of the sphere that takes in every vertex. */
#ifndef ORB_REMESH_SUBDIVISION_H
#define ORB_REMESH_SUBDIVISION_H

#include "remesh/common/job.h"

ORB_MUST_CHECK orb_status orb_remesh_subdivision(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out);

#endif
