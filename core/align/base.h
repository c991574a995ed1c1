/* The base of patches: a triangulation of the targets, and its edges traced as paths on a shape. */
#ifndef ORB_ALIGN_BASE_H
#define ORB_ALIGN_BASE_H

#include "align/sheet.h"

enum { ORB_BASE_EXTRA = 6 };

/* Triangulates the sphere on distinct targets (3 each, unit) and ORB_BASE_EXTRA points of its own, which keep every
 * triangle well below a hemisphere. In the sheet made, vertices 0 … ORB_BASE_EXTRA − 1 are the extra ones, then come
 * the targets. Every triangle is exactly positive; nearly Delaunay. *good 0 where two targets are too close to tell
 * apart. O(count²). */
ORB_MUST_CHECK orb_status orb_base_triangulate(orb_context *ctx, const double *targets, int32_t count, orb_sheet *out,
                                               int *good);

/* Paths of base edges on a sheet. Edge e of the base is named by its lesser half-edge. */
typedef struct orb_paths {
  int32_t *path;      /* of each half-edge of the sheet: the base edge whose path it lies on, −1 */
  unsigned char *on;  /* of each vertex: lies on a path or is a base vertex */
  int32_t half_edges; /* capacities */
  int32_t vertices;
} orb_paths;
void orb_paths_free(orb_context *ctx, orb_paths *paths);

/* Traces every edge of the base on the sheet, where base vertex b is sheet vertex at[b], without crossings and in the
 * base's order about each vertex. First a spanning tree, which nothing can block, then the rest: each of them lies
 * inside a disc of which both ends are on the border in the right order, so it exists; edges of the sheet are split
 * where a path crosses them, so that there is always room. Short paths are found by A* over vertices and the midpoints
 * of edges. *good 0 where a path broke, the sheet would grow beyond most_triangles or *work, which falls with every
 * node that is visited, is used up. */
ORB_MUST_CHECK orb_status orb_base_trace(orb_context *ctx, orb_sheet *sheet, const orb_sheet *base, const int32_t *at,
                                         orb_paths *paths, int32_t most_triangles, int64_t *work, int *good);

/* Splits an edge that lies on no path at its middle, with the paths' flags. */
ORB_MUST_CHECK orb_status orb_paths_split(orb_context *ctx, orb_sheet *sheet, orb_paths *paths, int32_t h,
                                          int32_t *vertex);

/* Embeds a sheet whose paths are those of a base: every patch in its spherical triangle (patches.c). May split edges.
 * *held 0 where rounding broke it; the points are then of no use. */
ORB_MUST_CHECK orb_status orb_patch_embed(orb_context *ctx, orb_sheet *sheet, const orb_sheet *base, int32_t *at,
                                          orb_paths *paths, int64_t *work, int *held);

/* Finds a base that all sheets share: its vertices are the landmarks, its edges join landmarks that are near on every
 * sheet, and its paths are traced on all sheets at once (sheets are refined; at, shape-major, holds the sheet vertex of
 * each landmark). The base is laid out on the sphere as evenly as its connectivity lets. count ≥ 4. *good 0 as above.
 */
ORB_MUST_CHECK orb_status orb_base_join(orb_context *ctx, orb_sheet *sheets, orb_paths *paths, int32_t shape_count,
                                        const int32_t *at, int32_t count, const int32_t *most_triangles, int64_t *work,
                                        orb_sheet *base, int *good);

#endif
