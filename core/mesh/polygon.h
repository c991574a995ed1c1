/* Cutting polygons into triangles. */
#ifndef ORB_MESH_POLYGON_H
#define ORB_MESH_POLYGON_H

#include "orbmorph/mesh.h"

/* Scratch for polygons of up to `room` corners. */
typedef struct orb_polygon {
  int32_t room;
  double *flat;         /* 2 per corner */
  int32_t *next, *prev; /* of the corners that are left; next −1: cut off */
  int32_t *reflex;      /* corners with a turn to the right, which alone can lie inside an ear */
  int32_t reflex_count;
  int64_t saved; /* tests that earlier polygons left over; below 0: tests that they took in advance */
} orb_polygon;

ORB_MUST_CHECK orb_status orb_polygon_reserve(orb_context *ctx, orb_polygon *polygon, int32_t corners);
void orb_polygon_free(orb_context *ctx, orb_polygon *polygon);

/* Writes count − 2 triangles over the corners 0 … count − 1, oriented like the polygon. vertex: the vertex of each
 * corner. O(count) over all polygons of a scratch: at most 32 tests of a point per corner and 4 million in all; a
 * polygon takes at most 256 per corner and 65,536. */
void orb_polygon_cut(orb_polygon *polygon, const double *positions, const int32_t *vertex, int32_t count,
                     int32_t *triangles);

#endif
