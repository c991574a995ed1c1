/* Texture coordinates at the corners of a supermesh. */
#ifndef ORB_TRANSFER_TEXCOORD_H
#define ORB_TRANSFER_TEXCOORD_H

#include "transfer/wedge.h"

/* Finds for each supermesh triangle the triangle of shape s that holds its centre on the sphere. Stage "write". */
ORB_MUST_CHECK orb_status orb_home_triangles(orb_context *ctx, const orb_supermesh *supermesh,
                                             const orb_aligned_shape *shape, int32_t s, int32_t *out);

/* Texture coordinates of the first shape; home: see orb_home_triangles(). No supermesh triangle straddles a seam: a
 * corner beyond one gets the coordinates of the point where the straight line from the triangle's centre meets the
 * seam.
 */
ORB_MUST_CHECK orb_status orb_wedge_texcoords(orb_context *ctx, const orb_supermesh *supermesh,
                                              const orb_aligned_shape *shape, const int32_t *home, orb_wedges *out);

/* Likewise for a set of texture coordinates of shape s, 2 per corner of its mesh. Only materials of the first
 * shape make seams, as the asset has its primitives. */
ORB_MUST_CHECK orb_status orb_wedge_charts(orb_context *ctx, const orb_supermesh *supermesh,
                                           const orb_aligned_shape *shape, int32_t s, const int32_t *home,
                                           const float *texcoords, orb_wedges *out);

#endif
