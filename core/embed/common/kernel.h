/* The kernel of a ring on the sphere: the points p with det(p, r_i, r_{i+1}) > 0 for every edge. A vertex placed there,
 * and only there, flips no triangle of its star (Peng & Timalsena 2016, section 5.1). */
#ifndef ORB_EMBED_COMMON_KERNEL_H
#define ORB_EMBED_COMMON_KERNEL_H

#include "orbmorph/context.h"

/* Whether p lies in the kernel, decided exactly. O(count). */
int orb_kernel_contains(const double (*ring)[3], int32_t count, const double p[3]);

/* Scratch memory for searches. Zero-initialise it; it grows as needed. */
typedef struct orb_kernel_room {
  double *block;
  int32_t capacity;
} orb_kernel_room;
void orb_kernel_room_free(orb_context *ctx, orb_kernel_room *room);

/* Finds a point well inside the kernel of a ring whose triangles r_0 r_i r_{i+1} are all positive, as after a vertex
 * split. In exact arithmetic such a kernel is never empty; *found is 0 where doubles cannot hold a point of it. The
 * kernel is clipped in the central projection at r_0; the result is its centroid, or a point between that and r_0.
 * O(count²) at worst, usually O(count). */
ORB_MUST_CHECK orb_status orb_kernel_point(orb_context *ctx, orb_kernel_room *room, const double (*ring)[3],
                                           int32_t count, double out[3], int *found);

#endif
