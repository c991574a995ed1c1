/* Generates closed meshes of genus zero. The context allocates the arrays: free with orb_mesh_free() or shape_free().
 */
#ifndef SUPPORT_SHAPES_H
#define SUPPORT_SHAPES_H

#include "orbmorph/mesh.h"

orb_mesh shape_tetrahedron(orb_context *ctx);
orb_mesh shape_octahedron(orb_context *ctx);
orb_mesh shape_icosahedron(orb_context *ctx);
/* Rings of `around` vertices between two poles, rows − 1 of them, on the unit sphere. */
orb_mesh shape_globe(orb_context *ctx, int around, int rows);
/* The same on a cylinder of radius 1 and the given length, flat caps. */
orb_mesh shape_cylinder(orb_context *ctx, int around, int rows, double length);
/* An octahedron with each face split into four `levels` times, on the unit sphere. */
orb_mesh shape_ball(orb_context *ctx, int levels);
/* A ball with `count` limbs: directions of length 1, and how far from the middle they reach. */
orb_mesh shape_creature(orb_context *ctx, int count, const double (*limb)[3], const double *reach, int levels);
/* The vertex that lies farthest along a direction. */
int32_t shape_farthest(const orb_mesh *mesh, const double direction[3]);
/* The number of repairs of a kind that the mesh reports. */
int64_t shape_repaired(const orb_mesh *mesh, const char *kind);
void shape_free(orb_context *ctx, orb_mesh *mesh);

#endif
