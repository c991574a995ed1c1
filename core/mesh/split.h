/* Splitting edges of more than two faces, so that each edge has two faces or one. */
#ifndef ORB_MESH_SPLIT_H
#define ORB_MESH_SPLIT_H

#include "mesh/surface.h"

/* Splits what it can; s->edges.crowded is what is left. *count: edges that it has split. Vertices where fans of faces
 * touch are split too. Sheets that end at such an edge become open there. O(F), O(F log k) for k faces at one edge. */
ORB_MUST_CHECK orb_status orb_surface_split(orb_surface *surface, int64_t *count);

#endif
