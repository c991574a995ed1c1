/* The filled holes of a closed mesh, and their rims. */
#ifndef ORB_MESH_HOLES_H
#define ORB_MESH_HOLES_H

#include "orbmorph/mesh.h"

typedef struct orb_hole {
  int32_t start, count; /* its rim: half_edges[start] … */
  int32_t edges;        /* of the rim in the file: splits do not count */
  double length;        /* of the rim */
  int is_simple;        /* the rim meets each of its vertices once, and no other rim meets them */
} orb_hole;

/* In the order of the lowest triangles that fill them, which splits do not change. */
typedef struct orb_hole_list {
  int32_t count;
  orb_hole *of;
  int32_t *half_edges; /* of the triangles that fill the holes, rim after rim, each in order */
  double *at;          /* of each: the length of the rim from its first half-edge to this one */
} orb_hole_list;

/* Finds the holes that fill_holes has filled: ORB_MADE_FILL on one side of a rim. Free `out` in any case. O(F). */
ORB_MUST_CHECK orb_status orb_holes_find(orb_context *ctx, const orb_mesh *mesh, orb_hole_list *out);
void orb_holes_free(orb_context *ctx, orb_hole_list *holes);

/* Whether fill_holes has filled a hole of the mesh. O(F). */
int orb_has_holes(const orb_mesh *mesh);

/* The place at share t of a half-edge: 0 at its origin, 1 at its end. */
static inline orb_place orb_place_on_half_edge(int32_t h, double t) {
  orb_place place = {.triangle = h / 3};
  place.at[h % 3] = 1 - t;
  place.at[orb_next(h) % 3] = t;
  return place;
}

#endif
