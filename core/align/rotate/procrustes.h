/* Orthogonal Procrustes on landmarks. Matrices are row-major; they act on columns: q = R p. */
#ifndef ORB_ALIGN_ROTATE_PROCRUSTES_H
#define ORB_ALIGN_ROTATE_PROCRUSTES_H

#include "align/sheet/sheet.h"

static inline void orb_rotate_point(const double rotation[9], const double p[3], double out[3]) {
  double q[3];
  for (int k = 0; k < 3; k++) {
    q[k] = rotation[3 * k] * p[0] + rotation[3 * k + 1] * p[1] + rotation[3 * k + 2] * p[2];
  }
  out[0] = q[0];
  out[1] = q[1];
  out[2] = q[2];
}

/* The proper rotation that minimises Σ |to[k] − R from[k]|². Where a reflection fits better, the singular vector of the
 * least singular value changes sign, which gives the best rotation (Peng & Timalsena 2016, section 7.1). singular (may
 * be NULL): the singular values, the last one negated where a reflection fits better. Where the points leave the
 * rotation open (fewer than two directions), returns one of the best. */
ORB_MUST_CHECK orb_status orb_procrustes(orb_context *ctx, const double *from, const double *to, int32_t count,
                                         double rotation[9], double singular[3]);

/* The same from a cross-covariance: maximises trace(R C), C = Σ from toᵀ. */
ORB_MUST_CHECK orb_status orb_procrustes_covariance(orb_context *ctx, const double covariance[9], double rotation[9],
                                                    double singular[3]);

/* Generalised Procrustes: the rotations of shapes 1, 2, … that bring landmarks together; shape 0 stays. points:
 * shape-major, 3 per landmark, not changed. rotations: 9 per shape. means (3 per landmark): the spherical means of the
 * rotated landmarks; where one does not exist, shape 0's point. */
ORB_MUST_CHECK orb_status orb_procrustes_all(orb_context *ctx, const double *points, int32_t shape_count,
                                             int32_t landmark_count, double *rotations, double *means);

/* The spherical means of landmarks, as in orb_procrustes_all(), under given rotations. */
void orb_procrustes_means(const double *points, int32_t shape_count, int32_t landmark_count, const double *rotations,
                          double *means);

#endif
