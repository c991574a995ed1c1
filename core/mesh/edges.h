/* The edges of a triangle list: which half-edges share one. */
#ifndef ORB_MESH_EDGES_H
#define ORB_MESH_EDGES_H

#include "orbmorph/mesh.h"

/* In place of a twin: the edge belongs to one face; to three or more, or it runs from a vertex to itself. */
enum { ORB_OPEN = -1, ORB_CROWDED = -2 };

typedef struct orb_edges {
  int64_t edges, open, crowded; /* undirected edges: all, those of one face, those of three or more */
  int64_t same_way;             /* edges that both of their faces list in the same direction */
} orb_edges;

/* twin[h] for each half-edge, in whichever direction the other one runs; ORB_OPEN or ORB_CROWDED where there is none.
 * Counting sort by the smaller vertex, then a short sort in each bucket: O(F), O(F log valence) at worst. */
ORB_MUST_CHECK orb_status orb_edges_match(orb_context *ctx, const int32_t *triangles, int32_t triangle_count,
                                          int32_t vertex_count, int32_t *twin, orb_edges *out);

#endif
