/* Finds the input triangle that each supermesh triangle lies in, from the places of its corners. */
#ifndef ORB_TRANSFER_INSIDE_H
#define ORB_TRANSFER_INSIDE_H

#include "orbmorph/remesh.h"

typedef struct orb_inside {
  int32_t *of;         /* per supermesh triangle: the input triangle that holds all three places; −1: none does */
  int32_t *first;      /* per input triangle, and one more: where its part of `held` begins */
  int32_t *held;       /* supermesh triangles, grouped by the input triangle they lie in, ascending in each group */
  int32_t *ring_first; /* per input vertex, and one more: where its part of `ring` begins */
  int32_t *ring;       /* half-edges of the input, grouped by the vertex they start at, ascending in each group */
} orb_inside;

/* O(F) of both meshes. */
ORB_MUST_CHECK orb_status orb_inside_make(orb_context *ctx, const orb_mesh *input, const int32_t *triangles,
                                          int32_t triangle_count, const orb_place *places, orb_inside *out);
void orb_inside_free(orb_context *ctx, orb_inside *inside);

/* The place's coordinates in another triangle of its mesh. Returns 0 if it does not lie there. Exact. */
int orb_place_in(const int32_t *triangles, const orb_place *place, int32_t triangle, double at[3]);

#endif
