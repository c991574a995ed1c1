/* Orthogonal Procrustes by SVD, for two point sets and, by alternation with the spherical means, for many (Gower 1975).
 */
#include <math.h>
#include <string.h>

#include "align/rotate.h"
#include "base/check.h"
#include "numeric/dense.h"
#include "numeric/vec3.h"

static const double SPREAD = 0.03; /* second singular value of directions that span a plane: 10° to either side */

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
    if (orb_normalize(mean) < 1e-3 * shapes) {
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
  for (int round = 0; shape_count > 2 && round < 100; round++) {
    for (int32_t s = 1; s < shape_count; s++) {
      ORB_TRY(orb_procrustes(ctx, points + (size_t)s * stride, means, landmark_count, rotations + 9 * (size_t)s, NULL));
    }
    double now = gather(points, shape_count, landmark_count, rotations, means);
    if (spread - now <= 1e-12 * spread) {
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

/* Do the landmarks of a shape, as directions, say how it is turned about any of them? */
static orb_status spans(orb_context *ctx, const double *points, int32_t count, int *yes) {
  double covariance[9] = {0}, rotation[9], singular[3];
  for (int32_t k = 0; k < count; k++) {
    for (int i = 0; i < 9; i++) {
      covariance[i] += points[3 * (size_t)k + (size_t)i / 3] * points[3 * (size_t)k + (size_t)i % 3] / count;
    }
  }
  ORB_TRY(orb_procrustes_covariance(ctx, covariance, rotation, singular));
  *yes = count > 2 && singular[1] > SPREAD;
  return ORB_OK;
}

orb_status orb_rotations_find(orb_context *ctx, const orb_aligned_shape *const *shapes, const double *points,
                              int32_t shape_count, int32_t landmark_count, double *rotations, double *means) {
  size_t stride = 3 * (size_t)landmark_count;
  int determined = 1;
  for (int32_t s = 0; determined && s < shape_count; s++) {
    ORB_TRY(spans(ctx, points + (size_t)s * stride, landmark_count, &determined));
  }
  ORB_TRY(orb_procrustes_all(ctx, points, shape_count, landmark_count, rotations, means));
  for (int32_t s = 1; !determined && s < shape_count; s++) {
    ORB_TRY(orb_rotation_search_near(ctx, shapes[0], shapes[s], points + (size_t)s * stride, points, landmark_count,
                                     rotations + 9 * (size_t)s, NULL));
  }
  if (!determined) {
    orb_procrustes_means(points, shape_count, landmark_count, rotations, means);
  }
  return ORB_OK;
}

static int is_identity(const double r[9]) {
  static const double one[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  return memcmp(r, one, sizeof one) == 0;
}

orb_status orb_sheet_rotate(orb_context *ctx, orb_sheet *sheet, const double rotation[9]) {
  const orb_mesh *mesh = &sheet->shape.mesh;
  int32_t vertices = mesh->vertex_count;
  if (is_identity(rotation)) {
    return ORB_OK;
  }
  double *old = ORB_NEW(ctx, double, 3 * (size_t)vertices), *points = sheet->shape.points;
  if (!old) {
    return ORB_E_NO_MEMORY;
  }
  memcpy(old, points, 3 * (size_t)vertices * sizeof *old);
  orb_status status = ORB_OK;
  orb_certificate certificate = {0};
  for (int attempt = 0; attempt < 12 && !certificate.valid && status == ORB_OK; attempt++) {
    /* Rounding is another for each of a family of rotations that differ by nanoradians. */
    double angle = 1e-9 * attempt, nudge[9] = {1, -angle, angle / 2, angle, 1, -angle / 3, -angle / 2, angle / 3, 1};
    for (int32_t v = 0; v < vertices; v++) {
      double *p = points + 3 * (size_t)v;
      orb_rotate_point(rotation, old + 3 * (size_t)v, p);
      if (attempt > 0) {
        orb_rotate_point(nudge, p, p);
      }
      orb_normalize(p);
    }
    status = orb_certify(ctx, points, vertices, mesh->triangles, mesh->triangle_count, &certificate);
  }
  if (status == ORB_OK && !certificate.valid) {
    status = orb_fail(ctx, ORB_E_NOT_CERTIFIED,
                      "A rotated sphere has triangles too thin for double precision; simplify the mesh a little.");
  }
  orb_free(ctx, old);
  return status;
}
