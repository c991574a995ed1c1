/* Orthogonal Procrustes by SVD, for two point sets and, by alternation with the spherical means, for many (Gower 1975).
 */
#include <math.h>
#include <string.h>

#include "align/rotate/procrustes.h"
#include "base/check.h"
#include "base/error.h"
#include "numeric/dense.h"
#include "numeric/vec3.h"

enum { ROUNDS = 100 };               /* most alternations */
static const double SETTLED = 1e-12; /* gain of the spread by one, relative to it, that ends them */
/* Shorter means of unit vectors have no direction (two opposite points); then the first shape's point is used.
 */
static const double NO_MEAN = 1e-3;

static double determinant(const double m[9]) {
  return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6]);
}

orb_status orb_procrustes_covariance(orb_context *ctx, const double covariance[9], double rotation[9],
                                     double singular[3]) {
  /* Cᵀ = Σ to fromᵀ = U S Vᵀ, and R = U D Vᵀ. */
  double a[9], u[9], v[9], s[3];
  for (int i = 0; i < 9; i++) {
    a[i] = covariance[3 * (i % 3) + i / 3];
    if (!isfinite(a[i])) {
      return orb_fail(ctx, ORB_E_INTERNAL, "The covariance of the landmarks is not finite.");
    }
  }
  orb_svd3(a, u, s, v);
  double sign = determinant(u) * determinant(v) < 0 ? -1 : 1;
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++) {
      rotation[3 * i + j] = u[3 * i] * v[3 * j] + u[3 * i + 1] * v[3 * j + 1] + sign * u[3 * i + 2] * v[3 * j + 2];
    }
  }
  if (singular) {
    singular[0] = s[0];
    singular[1] = s[1];
    singular[2] = sign * s[2];
  }
  return ORB_OK;
}

orb_status orb_procrustes(orb_context *ctx, const double *from, const double *to, int32_t count, double rotation[9],
                          double singular[3]) {
  double c[9] = {0};
  for (int32_t n = 0; n < count; n++) {
    for (int i = 0; i < 3; i++) {
      for (int j = 0; j < 3; j++) {
        c[3 * i + j] += from[3 * (size_t)n + (size_t)i] * to[3 * (size_t)n + (size_t)j];
      }
    }
  }
  return orb_procrustes_covariance(ctx, c, rotation, singular);
}

/* Spherical means of the rotated landmarks; returns Σ |mean − point|². */
static double gather(const double *points, int32_t shapes, int32_t count, const double *rotations, double *means) {
  double spread = 0;
  for (int32_t k = 0; k < count; k++) {
    double sum[3] = {0, 0, 0}, p[3], *mean = means + 3 * (size_t)k;
    for (int32_t s = 0; s < shapes; s++) {
      orb_rotate_point(rotations + 9 * (size_t)s, points + 3 * ((size_t)s * (size_t)count + (size_t)k), p);
      for (int i = 0; i < 3; i++) {
        sum[i] += p[i];
      }
    }
    memcpy(mean, sum, sizeof sum);
    if (orb_normalize(mean) < NO_MEAN * shapes) {
      orb_rotate_point(rotations, points + 3 * (size_t)k, mean);
      orb_normalize(mean);
    }
    for (int32_t s = 0; s < shapes; s++) {
      orb_rotate_point(rotations + 9 * (size_t)s, points + 3 * ((size_t)s * (size_t)count + (size_t)k), p);
      spread += orb_distance2(mean, p);
    }
  }
  return spread;
}

orb_status orb_procrustes_all(orb_context *ctx, const double *points, int32_t shape_count, int32_t landmark_count,
                              double *rotations, double *means) {
  size_t stride = 3 * (size_t)landmark_count;
  for (int32_t s = 0; s < shape_count; s++) {
    double *r = rotations + 9 * (size_t)s;
    memset(r, 0, 9 * sizeof *r);
    r[0] = r[4] = r[8] = 1;
    if (s > 0 && landmark_count > 0) {
      ORB_TRY(orb_procrustes(ctx, points + (size_t)s * stride, points, landmark_count, r, NULL));
    }
  }
  double spread = gather(points, shape_count, landmark_count, rotations, means);
  for (int round = 0; shape_count > 2 && round < ROUNDS; round++) {
    for (int32_t s = 1; s < shape_count; s++) {
      ORB_TRY(orb_procrustes(ctx, points + (size_t)s * stride, means, landmark_count, rotations + 9 * (size_t)s, NULL));
    }
    double now = gather(points, shape_count, landmark_count, rotations, means);
    if (spread - now <= SETTLED * spread) {
      break;
    }
    spread = now;
  }
  return ORB_OK;
}

void orb_procrustes_means(const double *points, int32_t shape_count, int32_t landmark_count, const double *rotations,
                          double *means) {
  (void)gather(points, shape_count, landmark_count, rotations, means);
}
