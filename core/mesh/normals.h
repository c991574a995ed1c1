/* Normals of a surface. */
#ifndef ORB_MESH_NORMALS_H
#define ORB_MESH_NORMALS_H

#include "orbmorph/mesh.h"

/* Unit normals (angle-weighted, Thürmer & Wüthrich 1998) of a closed surface; zero at a vertex that has none. O(V + F).
 */
ORB_MUST_CHECK orb_status orb_smooth_normals(orb_context *ctx, const double *positions, int32_t vertex_count,
                                             const int32_t *triangles, int32_t triangle_count, double *out);

/* The normal of one triangle; its length is twice the area. */
void orb_face_normal(const orb_mesh *mesh, int32_t triangle, double out[3]);

#endif
