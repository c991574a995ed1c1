/* The fixed shape of a composed map, packed for sweeps: vertices and triangles that are near on the surface lie near in
 * memory. */
#ifndef ORB_ALIGN_MAP_ENGINE_PACKED_H
#define ORB_ALIGN_MAP_ENGINE_PACKED_H

#include "align/map/engine/level.h"

enum { ORB_MAP_ROW = 12 }; /* doubles of a vertex or triangle that steps read together, with room for whole vectors */

typedef struct orb_map_packed {
  orb_map_surface b;    /* the same surface; without a locator */
  double *s;            /* what it borrows */
  int32_t *triangles;   /* likewise */
  double *vertex_row;   /* ORB_MAP_ROW a vertex: position, point on the sphere, normal */
  double *triangle_row; /* ORB_MAP_ROW a triangle: derivatives of its second barycentric coordinate along both tangents,
                           and of the third; the tangents; the density. Without area the derivatives are NAN */
  double *rotation;     /* 2 per half-edge: cosine and sine from the tangents of its triangle to those of its twin's */
  int32_t *vertex;      /* of each packed vertex: its number in the surface */
  int32_t *to, *from;   /* triangle numbers of the surface → packed ones, and back */
} orb_map_packed;

/* mesh: that of the surface. O(n). */
ORB_MUST_CHECK orb_status orb_map_packed_create(orb_context *ctx, const orb_mesh *mesh, const orb_map_surface *b,
                                                orb_map_packed *out);
/* Follows the surface to other points on the sphere (orb_map_surface_move()). O(n). */
void orb_map_packed_move(const orb_map_surface *b, orb_map_packed *p);

void orb_map_packed_free(orb_context *ctx, orb_map_packed *p);

/* Converts the places of a level to the packed surface, and back. Steps give the same bytes on both. */
void orb_map_packed_enter(const orb_map_packed *p, orb_map_level *level);
void orb_map_packed_leave(const orb_map_packed *p, orb_map_level *level);

#endif
