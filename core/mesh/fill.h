/* Filling holes. */
#ifndef ORB_MESH_FILL_H
#define ORB_MESH_FILL_H

#include "mesh/surface.h"

/* Closes each boundary loop with triangles. fans: each with a fan around a new vertex, which uses no diagonal.
 * *loops: how many. O(F), and O(48²) for each edge of a short loop. */
ORB_MUST_CHECK orb_status orb_surface_fill(orb_surface *surface, int fans, int64_t *loops);

#endif
