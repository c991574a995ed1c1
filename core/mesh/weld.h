/* Welding of open edges that lie at the same positions. */
#ifndef ORB_MESH_WELD_H
#define ORB_MESH_WELD_H

#include "mesh/edges.h"

/* Welds open edges of equal positions, drops the faces that thereby collapse or repeat another, and notes what it did.
 * twin and edges are those of the mesh, before and after. O(V + F) expected. */
ORB_MUST_CHECK orb_status orb_mesh_weld(orb_context *ctx, orb_mesh *mesh, int32_t *twin, orb_edges *edges);

#endif
