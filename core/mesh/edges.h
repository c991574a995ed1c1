/* Edges of a triangle list: which half-edges meet. */
#ifndef ORB_MESH_EDGES_H
#define ORB_MESH_EDGES_H

#include "orbmorph/mesh.h"

/* In place of a twin: an edge of one face; an edge of three faces or more (or from a vertex to itself). */
enum { ORB_OPEN = -1, ORB_CROWDED = -2 };

typedef struct orb_edges {
  int64_t edges, open, crowded; /* undirected edges; open ones; those of three faces or more */
  int64_t same_way;             /* edges of two faces that run through it the same way */
} orb_edges;

/* twin[h] for each half-edge, whichever way its fellow runs; else ORB_OPEN or ORB_CROWDED. Buckets by the smaller
 * vertex (counting sort), then a short sort in each bucket: O(F) and O(F log valence) at worst. */
ORB_MUST_CHECK orb_status orb_edges_match(orb_context *ctx, const int32_t *triangles, int32_t triangle_count,
                                          int32_t vertex_count, int32_t *twin, orb_edges *out);

#endif
