/* The edges of a base traced as paths on a shape. */
#ifndef ORB_ALIGN_PIN_BASE_TRACE_H
#define ORB_ALIGN_PIN_BASE_TRACE_H

#include "align/pin/paths.h"

/* Traces every edge of the base on the sheet, where base vertex b is sheet vertex at[b], without crossings and in the
 * base's order around each vertex. First come the edges of a spanning tree, which nothing can block. Each of the others
 * lies in a disc with both its ends on the border in the right order, so a path exists; edges of the sheet are split
 * where a path crosses them, so there is always room. A* over vertices and midpoints of edges finds short paths. *good
 * 0: a path broke, the sheet would grow beyond most_triangles, or *work is spent, which falls by 1 for each node
 * visited. */
ORB_MUST_CHECK orb_status orb_base_trace(orb_context *ctx, orb_sheet *sheet, const orb_sheet *base, const int32_t *at,
                                         orb_paths *paths, int32_t most_triangles, int64_t *work, int *good);

#endif
