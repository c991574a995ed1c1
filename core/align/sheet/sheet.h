/* A surface with its embedding that can be refined in place: edges and triangles are split on the surface and on the
 * sphere at once, without a change of shape. */
#ifndef ORB_ALIGN_SHEET_SHEET_H
#define ORB_ALIGN_SHEET_SHEET_H

#include "orbmorph/align.h"

/* Where a new vertex lies: coordinates (sum 1) over three vertices of the given mesh, all of one of its triangles. */
typedef struct orb_origin {
  int32_t vertex[3]; /* −1: none, weight 0 */
  double weight[3];
} orb_origin;

/* Owns the aligned shape that it grows, until orb_sheet_release(). Every triangle lies in triangle parent[t] of the
 * mesh it was made from; new vertices have source −1. */
typedef struct orb_sheet {
  orb_aligned_shape shape;
  int32_t *twin;   /* of each half-edge */
  int32_t *corner; /* of each vertex: one half-edge that leaves it */
  int32_t vertex_capacity, triangle_capacity;
  int32_t landmark_count; /* of shape.landmark_vertices */
  int32_t given_vertices;
  /* Corners of the triangles of the given mesh, borrowed, and of each new vertex, from given_vertices on, where it lies
   * (room for vertex_capacity − given_vertices): for orb_sheet_thin(). Both NULL where triangles were flipped. */
  const int32_t *given;
  orb_origin *origin;
} orb_sheet;

/* A deep copy of mesh and points, unsplit; the mesh's triangles are borrowed too. */
ORB_MUST_CHECK orb_status orb_sheet_create(orb_context *ctx, const orb_mesh *mesh, const double *points,
                                           orb_sheet *out);
void orb_sheet_free(orb_context *ctx, orb_sheet *sheet);

/* A second, independent copy. */
ORB_MUST_CHECK orb_status orb_sheet_copy(orb_context *ctx, const orb_sheet *sheet, orb_sheet *out);

/* Hands the shape over (its certificate is not touched) and frees the rest. */
void orb_sheet_release(orb_context *ctx, orb_sheet *sheet, orb_aligned_shape *out);

/* Splits half-edge h at fraction t of its way (0 < t < 1) and its twin with it: one vertex and two triangles more.
 * Triangle h/3 keeps the part at h's origin. The sphere point lies on the great circle arc, at the same fraction of
 * the chord. O(1) amortised. */
ORB_MUST_CHECK orb_status orb_sheet_split_edge(orb_context *ctx, orb_sheet *sheet, int32_t h, double t,
                                               int32_t *vertex);

/* Splits a triangle at barycentric coordinates (all > 0): one vertex and two triangles more. */
ORB_MUST_CHECK orb_status orb_sheet_split_triangle(orb_context *ctx, orb_sheet *sheet, int32_t triangle,
                                                   const double at[3], int32_t *vertex);

/* The next half-edge that leaves the same vertex, counter-clockwise. */
static inline int32_t orb_sheet_swing(const orb_sheet *sheet, int32_t h) {
  return sheet->twin[orb_prev(h)];
}

/* The half-edge from vertex a to vertex b, −1 if they are no neighbours. O(valence). */
int32_t orb_sheet_edge(const orb_sheet *sheet, int32_t a, int32_t b);

#endif
