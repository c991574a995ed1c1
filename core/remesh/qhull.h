/* The convex hull of points on the sphere, by Qhull. */
#ifndef ORB_REMESH_QHULL_H
#define ORB_REMESH_QHULL_H

#include "orbmorph/context.h"

/* Bounds Qhull's memory, about a kibibyte a point, to about 4 GiB. */
enum { ORB_QHULL_POINTS_MAX = 4000000 };

/* Corners of the hull's triangulated facets, 3 per triangle, outward, as Qhull computed them: facets may be degenerate
 * and points may be missing, so the caller certifies the result. Deterministic. The caller frees *triangles. Qhull's
 * own memory, about a kibibyte a point, is reserved from the context's budget while it runs. Cancellation and deadlines
 * are heeded. Errors: ORB_E_TOO_LARGE beyond ORB_QHULL_POINTS_MAX points; ORB_E_NOT_CERTIFIED where Qhull gives up. */
ORB_MUST_CHECK orb_status orb_qhull(orb_context *ctx, const double *points, int32_t count, int32_t **triangles,
                                    int32_t *triangle_count);

#endif
