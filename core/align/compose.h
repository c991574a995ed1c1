/* The composed map: lowering the distortion of the map from one shape straight to another, rather than that of each
 * shape's own embedding. See compose.c for the method. */
#ifndef ORB_ALIGN_COMPOSE_H
#define ORB_ALIGN_COMPOSE_H

#include "orbmorph/align.h"
#include "orbmorph/remesh.h"

/* Composed energies below it say that shapes correspond: no further start is tried. */
static const double CM_GOOD_ENERGY = 1.2;

/* What the first spatial targets of a composed map follow. */
typedef enum cm_from {
  CM_FROM_SPACE, /* what fits best in space */
  CM_FROM_MAP,   /* the map as given, which is roughly right */
  CM_SPACE_ONLY, /* what fits best in space; and where nothing comes of that, no more is tried */
  CM_SPACE_DONE, /* what fits best in space, but for what CM_SPACE_ONLY has tried already */
  CM_MAP_ONLY    /* none: the map as given is improved where it is, roughly and at little cost */
} cm_from;

/* Improves the points of `moving` on the sphere so that the map moving → sphere → fixed is as isometric as can be. The
 * landmarks (vertices of both, whose points are bit-equal already) stay together. both: the fixed shape's points may
 * change too, which leaves more room, and the shapes may change places; else they stay, for further shapes. The result
 * is certified and better than what was given, or else all points are left as they are and *improved is 0. energy[2]:
 * composed symmetric Dirichlet, capped at 20 and weighted by area, before and after. Stage "align". */
ORB_MUST_CHECK orb_status orb_compose(orb_context *ctx, orb_aligned_shape *fixed, orb_aligned_shape *moving, int both,
                                      int32_t landmark_count, cm_from from, orb_preset preset, double energy[2],
                                      int *improved);

/* ---- The inside, shared by the files compose*.c ---- */

/* The fixed shape: a surface on which points move. Scaled to area 4π about its centre. */
typedef struct cm_surface {
  int32_t vertex_count, triangle_count;
  double *x;       /* positions, 3 a vertex */
  double *normal;  /* unit, angle-weighted, 3 a vertex */
  const double *s; /* on the sphere, borrowed */
  const int32_t *triangles;
  int32_t *twin;
  double *frame;   /* 6 a triangle: two orthonormal tangents */
  double *density; /* a triangle: sphere determinant over twice its area */
  double centre[3], scale;
  orb_locator *locator;
} cm_surface;

ORB_MUST_CHECK orb_status cm_surface_create(orb_context *ctx, const orb_aligned_shape *shape, cm_surface *out);
void cm_surface_free(orb_context *ctx, cm_surface *b);

/* Position on the surface, on the sphere, and the interpolated normal of a place. Any output may be NULL. */
void cm_surface_at(const cm_surface *b, const orb_place *place, double y[3], double x[3], double n[3]);

/* The corner of a place's triangle that is nearest to it. */
int32_t cm_nearest_corner(const int32_t *triangles, const orb_place *place);

/* Walks straight from a place by `step` (in the frame of its triangle), unfolding over edges. 0 if it does not end. */
int cm_surface_trace(const cm_surface *b, const orb_place *from, const double step[2], orb_place *out);

/* Angle-weighted unit vertex normals. */
void cm_normals(const double *x, int32_t vertex_count, const int32_t *triangles, int32_t triangle_count, double *out);

/* Further landmarks, guessed: mirror images of the given ones where both shapes are nearly their own mirror images
 * (compose_mirror.c). landmarks: vertices of either shape, `count` each; guesses: likewise, room for `count` each;
 * *guess_count: how many were found. */
ORB_MUST_CHECK orb_status cm_mirror_landmarks(orb_context *ctx, const orb_mesh *const meshes[2],
                                              const int32_t *const landmarks[2], int32_t count,
                                              int32_t *const guesses[2], int32_t *guess_count);

/* What holds a spatial target: vertices of the moving shape and where they belong, 3 doubles each. The first `exact`
 * are landmarks and hold exactly, the others are samples of a map that is known roughly. */
typedef struct cm_anchors {
  int32_t count, exact;
  const int32_t *vertex;
  const double *goal;
} cm_anchors;

/* Spatial targets: where each vertex of the moving shape would lie if it were bent onto the fixed one in space: a
 * thin-plate spline through the anchors, then annealed non-rigid ICP. x, normal: of the moving shape, scaled like
 * cm_surface; out: 3 a vertex. With fewer than four anchors rigid ICP from 24 rotations comes first. *fit: mean
 * distance from the fixed shape in the end. */
ORB_MUST_CHECK orb_status cm_spatial_targets(orb_context *ctx, const cm_surface *b, const double *x,
                                             const double *normal, int32_t vertex_count, const cm_anchors *anchors,
                                             double *out, double *fit);

/* The rotation nearest to a 3×3 matrix, both row-major (Kabsch; reflections turned back). 0: it is not finite. */
int cm_nearest_rotation(const double h[9], double r[9]);

/* `count` vertices spread over a shape by farthest points; out: their numbers. */
ORB_MUST_CHECK orb_status cm_spread(orb_context *ctx, const double *x, int32_t vertex_count, int32_t count,
                                    int32_t *out);

#endif
