/* What tracing an edge through a shape and locating a vertex on it read, packed so that a step touches two cache lines.
 */
#ifndef ORB_REMESH_PLACED_PACK_H
#define ORB_REMESH_PLACED_PACK_H

#include "orbmorph/mesh.h"
#include "sphere/walk.h"

/* Where an arc that entered a triangle over a half-edge goes on. */
typedef struct orb_pack_step {
  int32_t apex;    /* the corner that is not on the half-edge */
  int32_t over[2]; /* the twins of the next half-edge, from the end to the apex, and of the one after it */
  int32_t unused;
} orb_pack_step;

/* A vertex of a shape, a cache line. */
typedef struct orb_pack_vertex {
  double point[3];    /* on the sphere */
  double position[3]; /* in space, divided by the shape's diagonal */
  double unused[2];
} orb_pack_vertex;

typedef struct orb_pack {
  orb_pack_step *step;     /* per half-edge */
  orb_pack_vertex *vertex; /* per vertex */
} orb_pack;

/* Finds the triangle that holds p strictly inside, and where, by a walk from place->triangle. Returns 0 where that
 * takes exact predicates or many steps; then place is undefined. */
int orb_pack_locate(const orb_pack *pack, const orb_sphere_view *view, const double p[3], orb_place *place);

#endif
