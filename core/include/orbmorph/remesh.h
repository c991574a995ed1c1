/* Supermeshes: one connectivity on the sphere that stands for all aligned shapes. */
#ifndef ORBMORPH_REMESH_H
#define ORBMORPH_REMESH_H

#include "orbmorph/align.h"
#include "orbmorph/locate.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum orb_remesh_method {
  ORB_REMESH_ADAPTIVE = 0,
  ORB_REMESH_OVERLAY,
  ORB_REMESH_SUBDIVISION,
  ORB_REMESH_CONVEX_HULL
} orb_remesh_method;

typedef struct orb_remesh_options {
  orb_remesh_method method;
  double tolerance;      /* adaptive: position error relative to each shape's diagonal, 0.001; it always holds, by
                            construction, as far as doubles tell (1e-12), unless max_triangles is too small for it */
  int64_t max_triangles; /* 0: none; wins over tolerance */
} orb_remesh_options;
void orb_remesh_defaults(orb_remesh_options *options);
/* Whether this build has the method; orb_remesh() answers ORB_E_UNSUPPORTED for one that it has not. */
int orb_remesh_available(orb_remesh_method method);

/* Always closed, manifold, genus zero: T = 2V − 4, and no flipped triangle on the sphere. */
typedef struct orb_supermesh {
  int32_t vertex_count, triangle_count, shape_count, landmark_count;
  int32_t *triangles;         /* 3 a triangle, outward */
  double *points;             /* 3 a vertex, unit */
  orb_place *places;          /* shape-major: places[s · vertex_count + v] on the mesh of aligned shape s */
  int32_t *landmark_vertices; /* landmark_count: each is one vertex (−1 if the method keeps none) */
  double *error_bound;        /* shape_count: proved bound on the distance, in the shape's units; NaN: none proved */
  int64_t flipped;            /* on the sphere: 0 */
  int32_t degree;             /* 1 */
} orb_supermesh;

/* Makes one supermesh for all aligned shapes; their meshes and points are certified, landmark vertices bit-equal where
 * they are to be kept. Places are exact corners where a supermesh vertex is a vertex of the shape. Which methods keep
 * all input vertices: overlay, subdivision and convex-hull (the paper's Fig. 11 baseline: the Delaunay triangulation of
 * all vertices, of at most 4 million, whose error is proved but not controlled); adaptive keeps the landmarks. options
 * NULL: defaults. Errors: ORB_E_BAD_OPTION, ORB_E_UNSUPPORTED, ORB_E_TOO_LARGE, ORB_E_NOT_CERTIFIED. Stage "remesh". */
ORB_MUST_CHECK orb_status orb_remesh(orb_context *ctx, const orb_aligned_shape *shapes, int32_t shape_count,
                                     int32_t landmark_count, const orb_remesh_options *options, orb_supermesh *out);
void orb_supermesh_free(orb_context *ctx, orb_supermesh *supermesh);

/* Certifies triangles and points, exactly: closed, manifold, connected, T = 2V − 4, every triangle positive, degree 1.
 * Sets flipped and degree; ORB_E_NOT_CERTIFIED says what does not hold. orb_remesh() asks it of every result. O(T). */
ORB_MUST_CHECK orb_status orb_supermesh_check(orb_context *ctx, orb_supermesh *supermesh);

#ifdef __cplusplus
}
#endif
#endif
