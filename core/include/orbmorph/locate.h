/* Point location on an embedded mesh: finds the triangle that holds a direction. */
#ifndef ORBMORPH_LOCATE_H
#define ORBMORPH_LOCATE_H

#include "orbmorph/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Borrows the arrays passed to orb_locator_create(). Any thread may query it. */
typedef struct orb_locator orb_locator;

ORB_API ORB_MUST_CHECK orb_status orb_locator_create(orb_context *ctx, const double *points, int32_t vertex_count,
                                                     const int32_t *triangles, int32_t triangle_count,
                                                     const int32_t *twin,
                                                     orb_locator **out); /* twin NULL: computed here */

ORB_API void orb_locator_destroy(orb_context *ctx, orb_locator *locator);

/* The triangle that holds the direction p (unit), and the barycentric coordinates of p in it by central projection.
 * hint: a triangle near p, or −1. Exact predicates decide, so the result is correct even on edges. If several triangles
 * hold p, the result is the one with the lowest number, whatever the hint. */
ORB_API void orb_locate(const orb_locator *locator, const double p[3], int32_t hint, orb_place *out);

#ifdef __cplusplus
}
#endif
#endif
