/* Multiresolution under an embedding: a decimation that can be undone exactly. `newton` undoes it from end to end.
 * Alignment stops at a coarse level, walks landmarks to their targets, pins them, and refines on. */
#ifndef ORB_EMBED_NEWTON_HIERARCHY_H
#define ORB_EMBED_NEWTON_HIERARCHY_H

#include "orbmorph/mesh.h"

typedef struct orb_hierarchy orb_hierarchy;

/* Decimates to a tetrahedron with carried areas. keep (a flag per vertex of the mesh, or NULL): these vertices are not
 * collapsed while more than keep_until vertices live. O(n log n). */
ORB_MUST_CHECK orb_status orb_hierarchy_create(orb_context *ctx, const orb_mesh *mesh, const unsigned char *keep,
                                               int32_t keep_until, orb_hierarchy **out);
void orb_hierarchy_destroy(orb_context *ctx, orb_hierarchy *hierarchy); /* NULL is fine */

#endif
