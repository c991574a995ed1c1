/* The adaptive method: as few triangles as keep every shape within the tolerance. */
#ifndef ORB_REMESH_ADAPTIVE_ADAPTIVE_H
#define ORB_REMESH_ADAPTIVE_ADAPTIVE_H

#include "remesh/common/job.h"

ORB_MUST_CHECK orb_status orb_remesh_adaptive(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out);

#endif
