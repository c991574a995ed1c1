/* Rims of holes as edges of a supermesh. */
#ifndef ORB_REMESH_PLACED_RIMS_H
#define ORB_REMESH_PLACED_RIMS_H

#include "remesh/common/job.h"

/* Whether the first shape has filled holes. O(triangles). */
int orb_rims_any(const orb_remesh_job *job);

/* Makes the rims of the first shape's filled holes edges of the supermesh, and sets has_rims; places and error bounds
 * are computed anew. Each vertex of a rim becomes a vertex, and so does each place where a rim crosses an edge. A
 * supermesh within the tolerance stays so. Leaves the supermesh as it is, with has_rims 0, if it would have more than
 * max_triangles, or if rounding does not allow an edge. */
ORB_MUST_CHECK orb_status orb_rims_add(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out);

#endif
