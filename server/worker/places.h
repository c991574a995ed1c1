/* The file of places: where each vertex of a supermesh lies in the uploaded files.
 *
 * Little-endian, without padding:
 *
 *   char[8] "ORBPLACE", uint32 version (1), uint32 shapes, uint32 vertices (of the supermesh),
 *   then for each shape in the request's order, for each vertex in the supermesh's order:
 *     int32 triangle       of the uploaded file, in file order after polygons were triangulated; −1: the vertex lies
 *                          on a face that a repair added
 *     float64[3]           barycentric coordinates (≥ 0, sum 1 up to rounding) for that triangle's corners in the
 *                          file's order; 0, 0, 0 where triangle is −1
 *
 *   then char[8] "GLBVERTS", uint32 vertices of the asset, and for each vertex of the asset, primitive by primitive,
 *   uint32: the supermesh vertex that it represents.
 *
 * Size in bytes: 20 + 28 · shapes · vertices + 12 + 4 · vertices of the asset.
 */
#ifndef ORB_WORKER_PLACES_H
#define ORB_WORKER_PLACES_H

#include "orbmorph/merge.h"

/* Appends the file to out. meshes: the meshes given to the merge, one per shape; corners: from run_load_mesh(), one
 * array a shape. O(V · shapes). */
ORB_MUST_CHECK orb_status places_write(orb_context *ctx, const orb_mesh *meshes, int32_t *const *corners,
                                       const orb_merge_result *merged, orb_buffer *out);

#endif
