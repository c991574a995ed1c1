/* The base of patches: a triangulation of the targets on the sphere. */
#ifndef ORB_ALIGN_PIN_BASE_H
#define ORB_ALIGN_PIN_BASE_H

#include "align/sheet/sheet.h"

enum { ORB_BASE_EXTRA = 6 }; /* points beside the targets: the corners of an octahedron */

/* Triangulates the sphere on distinct targets (3 each, unit) and ORB_BASE_EXTRA further points, which keep every
 * triangle well below a hemisphere. Vertices 0 … ORB_BASE_EXTRA − 1 of the sheet are the further points; then come the
 * targets. Every triangle is exactly positive, and the triangulation is nearly Delaunay. *good 0: two targets are too
 * close to tell apart. O(count²). */
ORB_MUST_CHECK orb_status orb_base_triangulate(orb_context *ctx, const double *targets, int32_t count, orb_sheet *out,
                                               int *good);

#endif
