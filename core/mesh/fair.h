/* Fair surfaces in holes. */
#ifndef ORB_MESH_FAIR_H
#define ORB_MESH_FAIR_H

#include "mesh/patch.h"
#include "mesh/surface.h"

/* Moves the vertices inside the patch so that it continues the surface around its rim: the thin plate, whose Laplacian
 * is as smooth as can be, with the faces around the rim as its boundary. rim: the open half-edges of the surface that
 * leave the vertices of the rim. Where that gives no surface near the rim, the patch stays as it is. O(n^1.5) for n
 * vertices. Source: Botsch & Kobbelt, An intuitive framework for real-time freeform modeling, 2004. */
ORB_MUST_CHECK orb_status orb_patch_fair(const orb_surface *surface, const int32_t *rim, orb_patch *patch);

#endif
