/* Where every vertex of a supermesh lies in the uploaded files, as bytes that callers get.
 *
 * Little-endian, without padding:
 *
 *   char[8] "ORBPLACE", uint32 version (1), uint32 shapes, uint32 vertices (of the supermesh),
 *   then for each shape in the request's order, for each vertex in the supermesh's order:
 *     int32 triangle       of the uploaded file: file order, after polygons were made triangles; −1: none, for it lies
 *                          on a face that a repair made
 *     float64[3]           barycentric coordinates (≥ 0, sum 1 up to rounding) of that triangle's corners as they
 *                          stand in the file; 0, 0, 0 where triangle is −1
 *
 *   then char[8] "GLBVERTS", uint32 vertices of the asset, and for each of them, the vertices of its primitives one
 *   after another, uint32: the supermesh vertex that it stands for.
 *
 * So 20 + 28 · shapes · vertices + 12 + 4 · vertices of the asset bytes.
 */
#ifndef ORB_WORKER_PLACES_H
#define ORB_WORKER_PLACES_H

#include "orbmorph/merge.h"

/* meshes: as given to the merge, one a shape; corners: 3 a triangle of each file, its vertices in the file. Appends to
 * out. O(V · shapes). */
ORB_MUST_CHECK orb_status places_write(orb_context *ctx, const orb_mesh *meshes, int32_t *const *corners,
                                       const orb_merge_result *merged, orb_buffer *out);

/* From a place on the repaired mesh to the same in the file's numbers; triangle −1 where the file has none. */
void places_to_file(const orb_mesh *mesh, const int32_t *corners, const orb_place *from, orb_place *out);

#endif
