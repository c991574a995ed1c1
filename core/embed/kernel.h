/* The kernel of a spherical polygon: the points that see every edge from the left, det(p, r_i, r_{i+1}) > 0. A vertex
 * may go just there without flipping a triangle of its star (Peng & Timalsena 2016, section 5.1). */
#ifndef ORB_EMBED_KERNEL_H
#define ORB_EMBED_KERNEL_H

#include "orbmorph/context.h"

/* Exactly inside? */
int orb_kernel_contains(const double (*ring)[3], int32_t count, const double p[3]);

/* Room for one search. Zero-initialise; grows by itself. */
typedef struct orb_kernel_room {
  double *block;
  int32_t capacity;
} orb_kernel_room;
void orb_kernel_room_free(orb_context *ctx, orb_kernel_room *room);

/* A point well inside the kernel of a ring that is a fan from ring[0]: that is, the triangles r_0 r_i r_{i+1} are all
 * positive, as after a vertex split. In exact arithmetic there always is one. *found 0 where doubles cannot hold it.
 * The ring is clipped in the central projection at r_0; the centroid of the polygon is taken, or a point between it and
 * r_0. O(count²) at worst, O(count) as a rule. */
ORB_MUST_CHECK orb_status orb_kernel_point(orb_context *ctx, orb_kernel_room *room, const double (*ring)[3],
                                           int32_t count, double out[3], int *found);

#endif
