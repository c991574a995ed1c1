/* Cutting polygons into triangles. */
#ifndef ORB_MESH_POLYGON_H
#define ORB_MESH_POLYGON_H

#include "orbmorph/mesh.h"

/* Scratch for polygons of up to `room` corners. */
typedef struct orb_polygon {
  int32_t room;
  double *flat; /* 2 a corner */
  int32_t *next, *prev;
} orb_polygon;

ORB_MUST_CHECK orb_status orb_polygon_reserve(orb_context *ctx, orb_polygon *polygon, int32_t corners);
void orb_polygon_free(orb_context *ctx, orb_polygon *polygon);

/* Writes count − 2 triangles over the corners 0 … count − 1, oriented like the polygon. vertex: the vertex of each
 * corner. O(count) for convex polygons, O(256·count) otherwise. */
void orb_polygon_cut(orb_polygon *polygon, const double *positions, const int32_t *vertex, int32_t count,
                     int32_t *triangles);

#endif
