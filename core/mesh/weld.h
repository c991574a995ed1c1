/* Welding of open edges that lie at the same place. */
#ifndef ORB_MESH_WELD_H
#define ORB_MESH_WELD_H

#include "mesh/edges.h"

/* Welds open edges of equal places; drops the faces that collapse or repeat another by it; notes what it did. twin and
 * edges are those of the mesh, before and after. */
ORB_MUST_CHECK orb_status orb_mesh_weld(orb_context *ctx, orb_mesh *mesh, int32_t *twin, orb_edges *edges);

#endif
