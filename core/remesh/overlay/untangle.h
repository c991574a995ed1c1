/* Untangling the triangles that rounding flipped. */
#ifndef ORB_REMESH_OVERLAY_UNTANGLE_H
#define ORB_REMESH_OVERLAY_UNTANGLE_H

#include "orbmorph/context.h"

/* Moves vertices numbered `first_free` and above, in the second half of its rounds any vertex, until every triangle is
 * positive. Points move by about the rounding that flipped the triangles. ORB_E_NOT_CERTIFIED if some stay flipped. */
ORB_MUST_CHECK orb_status orb_overlay_untangle(orb_context *ctx, double *points, int32_t vertex_count,
                                               const int32_t *triangles, int32_t triangle_count, int32_t first_free);

#endif
