/* The fixed shape of a composed map in an order in which near vertices and triangles lie together, for sweeps. */
#ifndef ORB_ALIGN_MAP_ENGINE_PACKED_H
#define ORB_ALIGN_MAP_ENGINE_PACKED_H

#include "align/map/engine/level.h"

typedef struct orb_map_packed {
  orb_map_surface b;  /* the same surface; without a locator */
  double *s;          /* what it borrows */
  int32_t *triangles; /* likewise */
  int32_t *to, *from; /* triangle numbers of the surface → these, and back */
} orb_map_packed;

/* mesh: the surface's. O(n). */
ORB_MUST_CHECK orb_status orb_map_packed_create(orb_context *ctx, const orb_mesh *mesh, const orb_map_surface *b,
                                                orb_map_packed *out);
void orb_map_packed_free(orb_context *ctx, orb_map_packed *p);

/* The places of a level become such on the packed surface, and such on the surface again. Steps come to the same on
 * both. */
void orb_map_packed_enter(const orb_map_packed *p, orb_map_level *level);
void orb_map_packed_leave(const orb_map_packed *p, orb_map_level *level);

#endif
