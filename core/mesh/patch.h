/* The surface that fills one hole while it is made: a disc of triangles within the hole's rim. */
#ifndef ORB_MESH_PATCH_H
#define ORB_MESH_PATCH_H

#include "orbmorph/mesh.h"

typedef struct orb_patch {
  int32_t rim; /* vertices 0 … rim − 1 are those of the rim, in the order of the triangles */
  int32_t vertex_count, triangle_count;
  int32_t vertex_room, triangle_room;
  double *positions; /* 3 per vertex; the rim lies in the unit ball */
  double *size;      /* the edge length wanted at each vertex */
  double growth;     /* of that length, for each unit of distance from the rim */
  int32_t *like;     /* of each vertex: a vertex of the rim that is near */
  int32_t *triangles, *twin;
  double centre[3], scale; /* a point of the mesh is centre + scale · position */
} orb_patch;

/* A patch of the triangles `cut` (count − 2 of them, over the corners 0 … count − 1) within a loop of the mesh. most:
 * how many triangles it may get by orb_patch_refine(), besides those that split the last diagonals. coarser: how many
 * times faster than usual its edges grow towards the inside; at least 1. */
ORB_MUST_CHECK orb_status orb_patch_open(orb_context *ctx, const double *positions, const int32_t *loop, int32_t count,
                                         const int32_t *cut, int32_t most, double coarser, orb_patch *patch);
void orb_patch_close(orb_context *ctx, orb_patch *patch);

/* Splits and flips edges until they are as long as wanted: as on the rim near it, and longer inside, so that O(rim)
 * triangles suffice. Afterwards no edge inside joins two vertices of the rim, so none can be an edge of the mesh
 * already. O(triangles) a round, at most 64 rounds. */
ORB_MUST_CHECK orb_status orb_patch_refine(orb_context *ctx, orb_patch *patch);

/* The cotangent of the angle at c in the triangle a b c, between −20 and 20: needles have a bounded weight. */
double orb_patch_cotangent(const double *a, const double *b, const double *c);

#endif
