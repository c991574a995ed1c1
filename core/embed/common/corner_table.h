/* The working surface of an embedding: a closed triangle mesh in space-filling order, normalised to area 4π, whose
 * corners know their opposites. Decimation and its undo rewrite it in place.
 *
 * Corners. Triangle t has the corners 8t, 8t + 1, 8t + 2. One block of 8 words for each triangle holds their vertices,
 * the bits of the target area, their opposites and a spare word, so that a step around a vertex costs one cache line:
 * corner[c] is the vertex of corner c, opposite[c] the corner across the edge that lies opposite to it. */
#ifndef ORB_EMBED_COMMON_CORNER_TABLE_H
#define ORB_EMBED_COMMON_CORNER_TABLE_H

#include <string.h>

#include "orbmorph/mesh.h"

typedef struct orb_corner_table {
  int32_t vertex_count, triangle_count;
  int32_t *to_mesh, *from_mesh; /* vertex numbers: from Morton order to the mesh's own, and back */
  double *position;             /* 3 per vertex; centred, area 4π (but see orb_corner_table_create) */
  float *position4;             /* the same as floats, 4 per vertex; the last is the vertex's valence */
  int32_t *corner, *opposite;   /* 8 per triangle; opposite = corner + 4 */
  int32_t *vertex_corner;       /* a corner of each vertex */
  int32_t *valence;             /* of each vertex */
} orb_corner_table;

static inline int32_t orb_corner_next(int32_t c) {
  return (c & 3) == 2 ? c - 2 : c + 1;
}
static inline int32_t orb_corner_prev(int32_t c) {
  return (c & 3) == 0 ? c + 2 : c - 1;
}
/* The next corner of the same vertex, counter-clockwise. */
static inline int32_t orb_corner_swing(const orb_corner_table *s, int32_t c) {
  return orb_corner_next(s->opposite[orb_corner_next(c)]);
}
static inline int32_t orb_triangle_corner(int64_t triangle) {
  return (int32_t)(8 * triangle);
}
static inline void orb_corner_table_set_valence(orb_corner_table *s, int32_t v, int32_t valence) {
  s->valence[v] = valence;
  s->position4[4 * (int64_t)v + 3] = (float)valence;
}
/* Target area of the triangle of corner c. */
static inline float orb_corner_area(const orb_corner_table *s, int32_t c) {
  float area;
  memcpy(&area, &s->corner[c | 3], sizeof area);
  return area;
}
static inline void orb_corner_set_area(orb_corner_table *s, int32_t c, float area) {
  memcpy(&s->corner[c | 3], &area, sizeof area);
}

/* Builds the surface. Target areas sum to 4π, with a floor for vanishing triangles; where the whole area vanishes, all
 * triangles count alike. A mesh that is far thinner than long is scaled to less than 4π, so that floats hold it.
 * ORB_E_NOT_MANIFOLD and other errors if the mesh is not what orb_mesh_repair() leaves. O(n). */
ORB_MUST_CHECK orb_status orb_corner_table_create(orb_context *ctx, const orb_mesh *mesh, orb_corner_table *out);
void orb_corner_table_free(orb_context *ctx, orb_corner_table *surface);

#endif
