/* The vertices of an asset as corners of its supermesh. */
#ifndef ORB_CARRY_CORNERS_H
#define ORB_CARRY_CORNERS_H

#include "orbmorph/remesh.h"

/* A corner of the supermesh for each of vertex_count vertices of an asset: one of a triangle that uses the vertex, or
 * where no triangle of the asset is one of the supermesh, any of its supermesh vertex. −1: the vertex is not on it.
 * vertices: their supermesh vertices; triangles: of the asset, 3 numbers each. *out is freed by the caller. O(F). */
ORB_MUST_CHECK orb_status orb_corners_create(orb_context *ctx, const orb_supermesh *supermesh, const int32_t *vertices,
                                             int32_t vertex_count, const int32_t *triangles, int32_t triangle_count,
                                             int64_t **out);

#endif
