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

/* Writes count − 2 triangles of corner numbers 0 … count−1, in the polygon's own turn. vertex: count vertex numbers. */
void orb_polygon_cut(orb_polygon *polygon, const double *positions, const int32_t *vertex, int32_t count,
                     int32_t *triangles);

#endif
