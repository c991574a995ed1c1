/* Corners of an aligned shape as blends of vertices of its file. */
#ifndef ORB_CARRY_CORNER_BLEND_H
#define ORB_CARRY_CORNER_BLEND_H

#include "orbmorph/transfer.h"

typedef struct orb_corner_blend {
  int32_t vertex[3]; /* of the file */
  double weight[3];  /* not negative; their sum is 1 up to rounding */
} orb_corner_blend;

/* A blend for each corner of shape->mesh; *out is freed by the caller. A triangle that a repair made has none in the
 * file: its corners get those of the same vertex in another triangle, or else of the nearest vertex along edges.
 * corners: the vertices of the file's triangles. given: the mesh that was aligned. O(F) beyond repairs. */
ORB_MUST_CHECK orb_status orb_corner_blends_create(orb_context *ctx, const orb_mesh *given,
                                                   const orb_aligned_shape *shape, const int32_t *corners,
                                                   orb_corner_blend **out);

/* Blends `width` floats per vertex of the file into `width` per corner. */
void orb_corner_blends_apply(const orb_corner_blend *blends, int64_t count, const float *values, int32_t width,
                             float *out);

#endif
