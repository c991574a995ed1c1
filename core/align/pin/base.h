/* The base of patches: a triangulation of the targets, and its edges traced as paths on a shape. */
#ifndef ORB_ALIGN_PIN_BASE_H
#define ORB_ALIGN_PIN_BASE_H

#include "align/sheet/sheet.h"

enum { ORB_BASE_EXTRA = 6 };

/* Triangulates the sphere on distinct targets (3 each, unit) and ORB_BASE_EXTRA points of its own, which keep every
 * triangle well below a hemisphere. In the sheet made, vertices 0 … ORB_BASE_EXTRA − 1 are the extra ones, then come
 * the targets. Every triangle is exactly positive; nearly Delaunay. *good 0 where two targets are too close to tell
 * apart. O(count²). */
ORB_MUST_CHECK orb_status orb_base_triangulate(orb_context *ctx, const double *targets, int32_t count, orb_sheet *out,
                                               int *good);

#endif
