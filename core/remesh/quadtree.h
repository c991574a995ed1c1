/* The octahedron's quadtree (Peng & Timalsena 2016, section 8): four-way splits until a leaf holds at most one vertex
 * of each shape, balanced 2:1, closed to a conforming triangulation. */
#ifndef ORB_REMESH_QUADTREE_H
#define ORB_REMESH_QUADTREE_H

#include "remesh/common/job.h"

typedef struct orb_quadtree_item {
  int32_t shape, vertex;
  int32_t triangle; /* out: a triangle of the conforming mesh in or next to which the vertex lies */
} orb_quadtree_item;

typedef struct orb_quadtree_mesh {
  int32_t vertex_count, triangle_count, item_count;
  double *points;
  int32_t *triangles;
  orb_quadtree_item *items; /* the vertices of all shapes, leaf by leaf: neighbours on the sphere are mostly close */
} orb_quadtree_mesh;

ORB_MUST_CHECK orb_status orb_quadtree_build(orb_context *ctx, const orb_remesh_job *job, orb_quadtree_mesh *out);
void orb_quadtree_free(orb_context *ctx, orb_quadtree_mesh *mesh);

#endif
