/* Filling holes. */
#ifndef ORB_MESH_FILL_H
#define ORB_MESH_FILL_H

#include "mesh/surface.h"

typedef enum orb_fill {
  ORB_FILL_FLAT, /* no new vertices, where the edges allow that */
  ORB_FILL_FANS, /* a fan around a new vertex, which uses no diagonal */
  ORB_FILL_FAIR  /* flat up to 48 edges; a longer loop gets a surface that continues the one around it */
} orb_fill;

/* Closes each boundary loop with triangles. *loops: how many. O(F), and O(48²) for each edge of a short loop. Fair
 * surfaces have at most as many triangles together as the surface, but 16,384 are always allowed and 131,072 never
 * exceeded; where the loops are too long for that, they are coarser, or flat. */
ORB_MUST_CHECK orb_status orb_surface_fill(orb_surface *surface, orb_fill how, int64_t *loops);

#endif
