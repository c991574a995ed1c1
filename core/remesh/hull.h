/* The convex hull of points on the sphere, by Qhull. */
#ifndef ORB_REMESH_HULL_H
#define ORB_REMESH_HULL_H

#include "orbmorph/context.h"

/* Corners of the hull's triangulated facets, 3 a triangle, outward: whatever Qhull made of the points, degenerate
 * facets included, and not always of every point; the caller certifies. Deterministic. *triangles is of the context.
 * Qhull's own memory, about a kibibyte a point, is reserved from the budget while it runs. ORB_E_TOO_LARGE beyond
 * ORB_HULL_POINTS_MAX points; ORB_E_NOT_CERTIFIED where Qhull gives up; cancellation and deadlines are heeded. */
enum { ORB_HULL_POINTS_MAX = 4000000 };
ORB_MUST_CHECK orb_status orb_hull(orb_context *ctx, const double *points, int32_t count, int32_t **triangles,
                                   int32_t *triangle_count);

#endif
