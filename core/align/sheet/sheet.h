/* The working copy of a shape: a surface with its embedding that can be refined in place. Splits act on the surface and
 * on the sphere at once and change no shape.
 *
 * In: a mesh, its embedding, and landmarks as places on it. Out: the refined mesh and its embedding, with landmarks as
 * vertices. Read in this order:
 *
 *   sheet.h      the working copy, and splits
 *   landmarks.h  landmarks as vertices
 *   untangle.h   local repair of folds
 *   collapse.h   collapses of vertices that splits made
 *   thin.h       removes such vertices where nothing needs them
 *   copy.h       decimated copies of shapes
 *   even.h       embeddings that keep angles
 *   copies.h     such copies in place of the later shapes of an alignment
 */
#ifndef ORB_ALIGN_SHEET_SHEET_H
#define ORB_ALIGN_SHEET_SHEET_H

#include "orbmorph/alignment.h"

/* Where a new vertex lies: coordinates (sum 1) on three vertices of one triangle of the given mesh. */
typedef struct orb_origin {
  int32_t vertex[3]; /* −1: none, weight 0 */
  double weight[3];
} orb_origin;

/* Owns the aligned shape that it refines, until orb_sheet_release(). Triangle t lies in triangle parent[t] of the mesh
 * it was made from; new vertices have source −1. */
typedef struct orb_sheet {
  orb_aligned_shape shape;
  int32_t *twin;   /* of each half-edge */
  int32_t *corner; /* of each vertex: one half-edge that leaves it */
  int32_t vertex_capacity, triangle_capacity;
  int32_t landmark_count; /* of shape.landmark_vertices */
  int32_t given_vertices;
  /* For orb_sheet_thin(): corners of the triangles of the given mesh, borrowed; and where each new vertex lies, from
   * given_vertices on (room for vertex_capacity − given_vertices). Both NULL after an edge flip. */
  const int32_t *given;
  orb_origin *origin;
} orb_sheet;

/* A deep copy of mesh and points, unsplit; the mesh's triangles are borrowed too. */
ORB_MUST_CHECK orb_status orb_sheet_create(orb_context *ctx, const orb_mesh *mesh, const double *points,
                                           orb_sheet *out);
void orb_sheet_free(orb_context *ctx, orb_sheet *sheet);

/* Frees a released shape and zeroes it. */
void orb_aligned_shape_free(orb_context *ctx, orb_aligned_shape *shape);

/* A second, independent copy. */
ORB_MUST_CHECK orb_status orb_sheet_copy(orb_context *ctx, const orb_sheet *sheet, orb_sheet *out);

/* Hands over the shape, without touching its certificate, and frees the rest. */
void orb_sheet_release(orb_context *ctx, orb_sheet *sheet, orb_aligned_shape *out);

/* Splits half-edge h at fraction t of its length (0 < t < 1), and its twin with it: adds one vertex and two triangles.
 * Triangle h/3 keeps the part at h's origin. The sphere point lies on the great circle arc, at the same fraction of the
 * chord. O(1) amortised. */
ORB_MUST_CHECK orb_status orb_sheet_split_edge(orb_context *ctx, orb_sheet *sheet, int32_t h, double t,
                                               int32_t *vertex);

/* Splits a triangle at barycentric coordinates (all > 0): adds one vertex and two triangles. */
ORB_MUST_CHECK orb_status orb_sheet_split_triangle(orb_context *ctx, orb_sheet *sheet, int32_t triangle,
                                                   const double at[3], int32_t *vertex);

/* The next half-edge that leaves the same vertex, counter-clockwise. */
static inline int32_t orb_sheet_swing(const orb_sheet *sheet, int32_t h) {
  return sheet->twin[orb_prev(h)];
}

/* The half-edge from vertex a to vertex b, −1 if they are not neighbours. O(valence). */
int32_t orb_sheet_edge(const orb_sheet *sheet, int32_t a, int32_t b);

/* Has an alignment failed because landmarks cannot be met there, or because a sphere has no room? Another way, or other
 * landmarks, may succeed then, so this clears the error. */
int orb_alignment_lacks_room(orb_context *ctx, orb_status status);
/* Moves the alignment of less energy to *one, and frees the other. *other is empty then. */
void orb_alignment_keep_better(orb_context *ctx, orb_alignment *one, orb_alignment *other);

/* Swaps the two shapes of an alignment without rims, with their landmarks, and the places of its alternatives. */
void orb_alignment_swap(orb_alignment *alignment);

/* Makes the landmarks of an alignment, but for the first `kept`, ordinary vertices: they were held, but not given. */
void orb_alignment_forget_landmarks(orb_context *ctx, int32_t kept, orb_alignment *alignment);

#endif
