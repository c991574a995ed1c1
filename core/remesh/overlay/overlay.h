/* The overlay method: every vertex, edge and crossing of the shapes. */
#ifndef ORB_REMESH_OVERLAY_OVERLAY_H
#define ORB_REMESH_OVERLAY_OVERLAY_H

#include "remesh/common/job.h"

ORB_MUST_CHECK orb_status orb_remesh_overlay(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out);

#endif
