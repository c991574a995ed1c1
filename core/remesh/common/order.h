/* Shapes numbered so that what is near on the sphere is near in memory. */
#ifndef ORB_REMESH_COMMON_ORDER_H
#define ORB_REMESH_COMMON_ORDER_H

#include "orbmorph/remesh.h"

typedef struct orb_shape_order {
  orb_aligned_shape *shapes; /* points, landmark vertices, and positions and triangles of the mesh; no attributes */
  int32_t **triangle;        /* per shape and triangle: its number in the given shape. The corners keep their order */
  int32_t count;
} orb_shape_order;

ORB_MUST_CHECK orb_status orb_shape_order_make(orb_context *ctx, const orb_aligned_shape *shapes, int32_t shape_count,
                                               int32_t landmark_count, orb_shape_order *out);
void orb_shape_order_free(orb_context *ctx, orb_shape_order *order);

/* Turns places on the ordered shapes into places on the given ones. */
void orb_shape_order_restore(const orb_shape_order *order, orb_supermesh *mesh);

#endif
