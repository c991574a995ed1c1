/* Point location on an embedded mesh: which triangle of the sphere holds a direction. */
#ifndef ORBMORPH_LOCATE_H
#define ORBMORPH_LOCATE_H

#include "orbmorph/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Point location on an embedded mesh by walking. The locator borrows its arrays; queries from any thread. */
typedef struct orb_locator orb_locator;

ORB_MUST_CHECK orb_status orb_locator_create(orb_context *ctx, const double *points, int32_t vertex_count,
                                             const int32_t *triangles, int32_t triangle_count, const int32_t *twin,
                                             orb_locator **out); /* twin may be NULL: made here */

void orb_locator_destroy(orb_context *ctx, orb_locator *locator);

/* The triangle that holds the direction p (unit), and p's central-projection barycentrics in it. hint: a triangle
 * near, or −1 for a spatial guess. Always ends; exact predicates decide, so the answer is right even on edges. */
void orb_locate(const orb_locator *locator, const double p[3], int32_t hint, orb_place *out);

#ifdef __cplusplus
}
#endif
#endif
