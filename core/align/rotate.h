/* Rotations of spheres: orthogonal Procrustes on landmarks, and a search over SO(3) without them. Matrices are row
 * major; they act on columns: q = R p. */
#ifndef ORB_ALIGN_ROTATE_H
#define ORB_ALIGN_ROTATE_H

#include "align/sheet.h"

static inline void orb_rotate_point(const double rotation[9], const double p[3], double out[3]) {
  double q[3];
  for (int k = 0; k < 3; k++) {
    q[k] = rotation[3 * k] * p[0] + rotation[3 * k + 1] * p[1] + rotation[3 * k + 2] * p[2];
  }
  out[0] = q[0];
  out[1] = q[1];
  out[2] = q[2];
}

/* The proper rotation that minimises Σ |to[k] − R from[k]|². A reflection that the data ask for is replaced by the
 * best rotation: the singular vector of the least singular value changes sign (Peng & Timalsena 2016, section 7.1).
 * singular (may be NULL): the singular values, the last one negated where a reflection would fit better. Where the
 * points leave the rotation open (fewer than two directions), one of the best is returned. */
ORB_MUST_CHECK orb_status orb_procrustes(orb_context *ctx, const double *from, const double *to, int32_t count,
                                         double rotation[9], double singular[3]);

/* The same for a cross-covariance that is at hand: maximises trace(R C), C = Σ from toᵀ. */
ORB_MUST_CHECK orb_status orb_procrustes_covariance(orb_context *ctx, const double covariance[9], double rotation[9],
                                                    double singular[3]);

/* Generalised Procrustes: rotates shapes 1, 2, … so that landmarks gather; shape 0 stays. points: shape-major, 3 a
 * landmark, not changed. rotations: 9 a shape. means (3 a landmark): the spherical means of the rotated landmarks;
 * where one does not exist, shape 0's point. */
ORB_MUST_CHECK orb_status orb_procrustes_all(orb_context *ctx, const double *points, int32_t shape_count,
                                             int32_t landmark_count, double *rotations, double *means);

/* The rotation of shape b's sphere under which the map a → b through the sphere is nearest to a rigid motion in
 * space: maximises the correlation of positions and normals over SO(3), on a coarse grid and then refined. Which way
 * the shapes stand in space is found with it, but a common upright frame is preferred where it explains nearly as
 * much. score (may be NULL): 1 for congruent shapes. About 0.1 s. */
ORB_MUST_CHECK orb_status orb_rotation_search(orb_context *ctx, const orb_aligned_shape *a, const orb_aligned_shape *b,
                                              double rotation[9], double *score);

/* Rotations of that kind that differ, best first, at most `most` (9 doubles each): the first is the one of
 * orb_rotation_search(), the others are what symmetric shapes could be matched by as well. */
ORB_MUST_CHECK orb_status orb_rotation_candidates(orb_context *ctx, const orb_aligned_shape *a,
                                                  const orb_aligned_shape *b, int32_t most, double *rotations,
                                                  int32_t *count);

/* The same where few landmarks are known: `from` (on b) and `to` (on a), 3 each. A rotation loses by the mean of the
 * squared distances between them, so that one landmark leaves a turn about it to the shapes, and two that are nearly
 * opposite likewise. */
ORB_MUST_CHECK orb_status orb_rotation_search_near(orb_context *ctx, const orb_aligned_shape *a,
                                                   const orb_aligned_shape *b, const double *from, const double *to,
                                                   int32_t count, double rotation[9], double *score);

/* The spherical means of landmarks (as for orb_procrustes_all()) under rotations at hand. */
void orb_procrustes_means(const double *points, int32_t shape_count, int32_t landmark_count, const double *rotations,
                          double *means);

/* orb_procrustes_all() where the landmarks determine the rotations; where they do not (one, two, or all in nearly one
 * direction and its opposite), each later shape is turned by orb_rotation_search_near(). */
ORB_MUST_CHECK orb_status orb_rotations_find(orb_context *ctx, const orb_aligned_shape *const *shapes,
                                             const double *points, int32_t shape_count, int32_t landmark_count,
                                             double *rotations, double *means);

/* Rotates the sphere points of a surface and certifies the rounded result, with nudged rotations where rounding broke
 * a triangle; ORB_E_NOT_CERTIFIED if none holds. The identity changes nothing. */
ORB_MUST_CHECK orb_status orb_sheet_rotate(orb_context *ctx, orb_sheet *sheet, const double rotation[9]);

#endif
