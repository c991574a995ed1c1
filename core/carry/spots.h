/* Corners of an aligned shape as blends of vertices of its file. */
#ifndef ORB_CARRY_SPOTS_H
#define ORB_CARRY_SPOTS_H

#include "orbmorph/transfer.h"

typedef struct orb_spot {
  int32_t vertex[3]; /* of the file */
  double weight[3];  /* not negative; their sum is 1 up to rounding */
} orb_spot;

/* A spot for each corner of shape->mesh; *out is freed by the caller. A triangle that a repair made has none in the
 * file: its corners get those of the same vertex in another triangle, or else of the nearest vertex along edges.
 * corners: the vertices of the file's triangles. given: the mesh that was aligned. O(F) beyond repairs. */
ORB_MUST_CHECK orb_status orb_spots_create(orb_context *ctx, const orb_mesh *given, const orb_aligned_shape *shape,
                                           const int32_t *corners, orb_spot **out);

/* Blends `width` floats a vertex of the file into `width` a corner. */
void orb_spots_blend(const orb_spot *spots, int64_t count, const float *values, int32_t width, float *out);

#endif
