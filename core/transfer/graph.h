/* The edges of a closed triangle list as a weighted graph: two shapes of the same triangles share it. */
#ifndef ORB_TRANSFER_GRAPH_H
#define ORB_TRANSFER_GRAPH_H

#include "orbmorph/context.h"

typedef struct orb_edge_graph {
  int32_t vertex_count;
  int32_t *first, *neighbor; /* of vertex v: neighbor[first[v]] … neighbor[first[v + 1] − 1] */
  double *weight;            /* per neighbour entry: symmetric, positive, without unit */
  double *diagonal;          /* per vertex: the sum of its weights */
} orb_edge_graph;

/* Weights an edge by the area of its two triangles over its squared length, on shapes a and b (3 per vertex) together:
 * a positive stand-in for cotangents. b counts at a's scale. On failure frees what it made. O(F). */
ORB_MUST_CHECK orb_status orb_edge_graph_make(orb_context *ctx, const double *a, const double *b, int32_t vertex_count,
                                              const int32_t *triangles, int32_t triangle_count, orb_edge_graph *out);
void orb_edge_graph_free(orb_context *ctx, orb_edge_graph *graph);

/* Twice the area of the triangle with these corners. */
double orb_twice_area(const double *positions, const int32_t corner[3]);

#endif
