/* The edges of a base traced as paths on a shape. */
#ifndef ORB_ALIGN_PIN_BASE_TRACE_H
#define ORB_ALIGN_PIN_BASE_TRACE_H

#include "align/pin/paths.h"

/* Traces every edge of the base on the sheet, where base vertex b is sheet vertex at[b], without crossings and in the
 * base's order about each vertex. First a spanning tree, which nothing can block, then the rest: each of them lies
 * inside a disc of which both ends are on the border in the right order, so it exists; edges of the sheet are split
 * where a path crosses them, so that there is always room. Short paths are found by A* over vertices and the midpoints
 * of edges. *good 0 where a path broke, the sheet would grow beyond most_triangles or *work, which falls with every
 * node that is visited, is used up. */
ORB_MUST_CHECK orb_status orb_base_trace(orb_context *ctx, orb_sheet *sheet, const orb_sheet *base, const int32_t *at,
                                         orb_paths *paths, int32_t most_triangles, int64_t *work, int *good);

#endif
