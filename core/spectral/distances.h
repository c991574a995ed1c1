/* Distances along a surface: shortest paths over edges and, across each edge, between the two opposite vertices, which
 * makes them nearly independent of the triangulation. For meshes of a few thousand vertices. */
#ifndef ORB_SPECTRAL_DISTANCES_H
#define ORB_SPECTRAL_DISTANCES_H

#include "orbmorph/mesh.h"

typedef struct orb_link {
  int32_t vertex;
  double length; /* INFINITY: no straight line between the two crosses their edge */
} orb_link;

typedef struct orb_heap_item {
  double distance;
  int32_t vertex;
} orb_heap_item;

/* The links of vertex v are link[start[v]] … link[start[v + 1] − 1]. */
typedef struct orb_distances {
  int32_t vertices;
  int32_t *start;
  orb_link *link;
  orb_heap_item *heap; /* room of one search */
  int64_t heap_count;
} orb_distances;

/* `out` is zeroed, or as a failed call left it; free it in any case. O(n). */
ORB_MUST_CHECK orb_status orb_distances_create(orb_context *ctx, const orb_mesh *mesh, orb_distances *out);
void orb_distances_free(orb_context *ctx, orb_distances *distances);

/* Distances from one vertex to all (Dijkstra 1959). O(n log n). */
void orb_distances_from(orb_distances *distances, int32_t vertex, double *out);

#endif
