/* The fixed shape of a composed map in an order in which near vertices and triangles lie together, for sweeps. */
#ifndef ORB_ALIGN_COMPOSE_PACKED_H
#define ORB_ALIGN_COMPOSE_PACKED_H

#include "align/compose_level.h"

typedef struct cm_packed {
  cm_surface b;       /* the same surface; without a locator */
  double *s;          /* what it borrows */
  int32_t *triangles; /* likewise */
  int32_t *to, *from; /* triangle numbers of the surface → these, and back */
} cm_packed;

/* mesh: the surface's. O(n). */
ORB_MUST_CHECK orb_status cm_packed_create(orb_context *ctx, const orb_mesh *mesh, const cm_surface *b, cm_packed *out);
void cm_packed_free(orb_context *ctx, cm_packed *p);

/* The places of a level become such on the packed surface, and such on the surface again. Steps come to the same on
 * both. */
void cm_packed_enter(const cm_packed *p, cm_level *level);
void cm_packed_leave(const cm_packed *p, cm_level *level);

#endif
