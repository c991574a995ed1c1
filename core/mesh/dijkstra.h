/* Shortest paths along edges from one vertex (Dijkstra 1959), each with the XOR of its edges' labels. The caller takes
 * vertices by distance with orb_dijkstra_pop(), settles them, and offers the edges that go on from there. */
#ifndef ORB_MESH_DIJKSTRA_H
#define ORB_MESH_DIJKSTRA_H

#include <math.h>

#include "mesh/surface.h"
#include "numeric/vec3.h"

/* The state of a vertex. MARKED is the caller's. */
enum { ORB_DIJKSTRA_UNSEEN, ORB_DIJKSTRA_WAITING, ORB_DIJKSTRA_SETTLED, ORB_DIJKSTRA_MARKED };

typedef struct orb_dijkstra {
  orb_surface *s;
  int32_t *corner;  /* of each vertex: a half-edge that leaves it, −1: no face uses it */
  uint64_t *label;  /* of each half-edge; the caller's */
  double *distance; /* of each vertex from the seed */
  int32_t *parent;  /* of each vertex: the half-edge by which its path arrives, −1: the seed */
  uint64_t *walked; /* of each vertex: the label of its path */
  unsigned char *state;
  int32_t *heap, *slot, heap_count; /* vertices by distance, and their places in the heap */
  int32_t *touched, touched_count;  /* the vertices that the last search reached */
} orb_dijkstra;

static inline int32_t orb_dijkstra_origin(const orb_dijkstra *p, int32_t h) {
  return p->s->mesh->triangles[h];
}
static inline int32_t orb_dijkstra_target(const orb_dijkstra *p, int32_t h) {
  return p->s->mesh->triangles[orb_next(h)];
}

/* Whether the file has this edge. */
static inline int orb_dijkstra_is_usable(const orb_dijkstra *p, int32_t h) {
  const int32_t *source = p->s->mesh->source_triangle;
  return source[h / 3] >= 0 || source[p->s->twin[h] / 3] >= 0;
}

static inline double orb_dijkstra_length(const orb_dijkstra *p, int32_t h) {
  const double *at = p->s->mesh->positions;
  return sqrt(orb_distance2(at + 3 * (size_t)orb_dijkstra_origin(p, h), at + 3 * (size_t)orb_dijkstra_target(p, h)));
}

/* Allocates for a surface and finds the corners; call orb_dijkstra_close() also after a failure. */
ORB_MUST_CHECK orb_status orb_dijkstra_open(orb_dijkstra *p, orb_surface *s);
void orb_dijkstra_close(orb_dijkstra *p);

/* Starts a search: only the seed is WAITING, all other vertices are UNSEEN. O(vertices touched by the last search). */
void orb_dijkstra_start(orb_dijkstra *p, int32_t seed);
/* Takes the nearest WAITING vertex; there must be one. The caller settles it. O(log V). */
int32_t orb_dijkstra_pop(orb_dijkstra *p);
/* Offers the end of half-edge h a path of this length over h, from a settled vertex. O(log V). */
void orb_dijkstra_reach(orb_dijkstra *p, int32_t h, double distance);

#endif
