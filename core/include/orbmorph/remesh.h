/* Supermeshes: one mesh on the sphere that stands for all aligned shapes. */
#ifndef ORBMORPH_REMESH_H
#define ORBMORPH_REMESH_H

#include "orbmorph/alignment.h"
#include "orbmorph/locate.h"
#include "orbmorph/remesh_methods.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ORB_REMESH_ADAPTIVE = 0, …: see remesh_methods.h. */
#define ORB_REMESH_ENUMERATOR(id, function, name, heeds) ORB_REMESH_##id,
typedef enum orb_remesh_method { ORB_REMESH_METHODS(ORB_REMESH_ENUMERATOR) ORB_REMESH_METHOD_COUNT } orb_remesh_method;
#undef ORB_REMESH_ENUMERATOR

/* The method's name, such as "convex-hull"; NULL if the number is not a method. */
ORB_API const char *orb_remesh_method_name(orb_remesh_method method);
/* Finds the method of a name, for programs that read it from a command line or a file. Returns 0, and leaves *out
 * unchanged, if there is none. */
ORB_API int orb_remesh_method_of_name(const char *name, orb_remesh_method *out);
/* 1 if this build has the method; otherwise 0, and orb_remesh() returns ORB_E_UNSUPPORTED. */
ORB_API int orb_remesh_available(orb_remesh_method method);
/* The options that the method uses, as a sum of these bits; it ignores the others, so a user interface can hide them.
 * All methods but adaptive keep what is given and refuse a max_triangles that is too small for it. */
enum { ORB_REMESH_HEEDS_TOLERANCE = 1, ORB_REMESH_HEEDS_MAX_TRIANGLES = 2 };
ORB_API unsigned orb_remesh_heeds(orb_remesh_method method);

typedef struct orb_remesh_options {
  orb_remesh_method method; /* default: ORB_REMESH_ADAPTIVE */
  /* Largest position error, relative to each shape's diagonal; default: 0.001. A method that uses it stays within it,
   * up to rounding (1e-12), unless max_triangles is too small for that. */
  double tolerance;
  /* Takes precedence over the tolerance; 0 (default): no limit. ORB_E_BAD_OPTION: the method needs more. */
  int64_t max_triangles;
  int rims; /* 1: the rims of the first shape's filled holes become edges, see has_rims; default: 0 */
} orb_remesh_options;
ORB_API void orb_remesh_defaults(orb_remesh_options *options);

/* Always closed, manifold, genus zero: T = 2V − 4, and no flipped triangle on the sphere. */
typedef struct orb_supermesh {
  int32_t vertex_count, triangle_count, shape_count, landmark_count;
  int32_t *triangles;         /* 3 per triangle, outward */
  double *points;             /* 3 per vertex, unit */
  orb_place *places;          /* shape major: places[s · vertex_count + v] on the mesh of aligned shape s */
  int32_t *landmark_vertices; /* landmark_count: the vertex of each landmark, −1 if the method keeps none */
  double *error_bound;        /* shape_count: proved bound on the distance, in the shape's units; NaN: none is proved */
  int64_t flipped;            /* on the sphere: 0 */
  int32_t degree;             /* 1 */
  int has_rims; /* 1: no triangle crosses the rim of a filled hole of the first shape (ORB_MADE_FILL). Always 1 with
                   overlay and template. With other methods, 1 if the options ask for rims, and neither max_triangles
                   nor rounding prevents it */
} orb_supermesh;

/* Makes one supermesh for all aligned shapes. The caller passes certified meshes and points. A landmark that the
 * supermesh keeps must have bit-equal points on all shapes. Where a supermesh vertex is a vertex of a shape, its place
 * is exactly that corner. overlay, subdivision and convex-hull keep all input vertices; adaptive keeps the landmarks.
 * convex-hull is the baseline of Peng & Timalsena 2016, Fig. 11: the Delaunay triangulation of all vertices, at most 4
 * million; its error is proved but not controlled. options NULL: defaults. Errors: ORB_E_BAD_OPTION, ORB_E_UNSUPPORTED,
 * ORB_E_TOO_LARGE, ORB_E_NOT_CERTIFIED; template: ORB_E_BAD_LANDMARKS if landmarks flip a triangle. Stage
 * "remesh". */
ORB_API ORB_MUST_CHECK orb_status orb_remesh(orb_context *ctx, const orb_aligned_shape *shapes, int32_t shape_count,
                                             int32_t landmark_count, const orb_remesh_options *options,
                                             orb_supermesh *out);
ORB_API void orb_supermesh_free(orb_context *ctx, orb_supermesh *supermesh);

/* Certifies triangles and points, exactly: closed, manifold, connected, T = 2V − 4, every triangle positive, degree 1.
 * Sets flipped and degree. ORB_E_NOT_CERTIFIED names what does not hold. orb_remesh() certifies every result. O(T). */
ORB_API ORB_MUST_CHECK orb_status orb_supermesh_check(orb_context *ctx, orb_supermesh *supermesh);

#ifdef __cplusplus
}
#endif
#endif
