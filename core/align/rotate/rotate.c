/* Rotations of sheets: by landmarks where these determine them, else by the search. Each result is certified. */
#include <math.h>
#include <string.h>

#include "align/rotate/correlate.h"
#include "align/rotate/procrustes.h"
#include "align/rotate/rotate.h"
#include "align/sheet/landmarks.h"
#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "numeric/vec3.h"

static const double SPREAD = 0.03; /* second singular value of directions that span a plane: 10° off their axis */
static const double NUDGE = 1e-9;  /* radians between attempts: rotations this near differ in how they round */
enum { ATTEMPTS = 12 };            /* rotations that are tried until the rounded result is certified */
enum { STEPS_OF_VERTEX = 60 };     /* for progress: for each vertex, a search takes as long as so many steps of a map */

/* Do the landmarks of a shape determine its rotation: do they span a plane as directions? */
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

/* Rotates the sphere points of a sheet and certifies the rounded result; tries slightly different rotations where
 * rounding breaks a triangle. ORB_E_NOT_CERTIFIED if none is certified. The identity changes nothing. */
static orb_status rotate_sheet(orb_context *ctx, orb_sheet *sheet, const double rotation[9]) {
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
  for (int attempt = 0; attempt < ATTEMPTS && !certificate.valid && status == ORB_OK; attempt++) {
    double angle = NUDGE * attempt, nudge[9] = {1, -angle, angle / 2, angle, 1, -angle / 3, -angle / 2, angle / 3, 1};
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

orb_status orb_rotate_by_search(orb_context *ctx, orb_sheet *sheets, int32_t shape_count) {
  for (int32_t s = 1; s < shape_count; s++) {
    double rotation[9];
    ORB_TRY(orb_rotation_search(ctx, &sheets[0].shape, &sheets[s].shape, rotation, NULL));
    ORB_TRY(rotate_sheet(ctx, &sheets[s], rotation));
    orb_progress_steps(ctx, STEPS_OF_VERTEX * (int64_t)sheets[s].vertex_capacity);
  }
  return ORB_OK;
}

orb_status orb_rotate_by_landmarks(orb_context *ctx, orb_sheet *sheets, int32_t shape_count, const int32_t *landmarks,
                                   int32_t count) {
  orb_status status = ORB_OK;
  double *points = NULL, *rotations = ORB_NEW(ctx, double, 9 * (size_t)shape_count),
         *means = ORB_NEW(ctx, double, 3 * (size_t)count);
  const orb_aligned_shape **shapes = ORB_NEW(ctx, const orb_aligned_shape *, shape_count);
  if (!rotations || !means || !shapes) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  ORB_GO(status, orb_landmark_points(ctx, sheets, shape_count, landmarks, count, &points), end);
  for (int32_t s = 0; s < shape_count; s++) {
    shapes[s] = &sheets[s].shape;
  }
  ORB_GO(status, orb_rotations_find(ctx, shapes, points, shape_count, count, rotations, means), end);
  for (int32_t s = 0; s < shape_count; s++) {
    ORB_GO(status, rotate_sheet(ctx, &sheets[s], rotations + 9 * (size_t)s), end);
  }
end:
  orb_free(ctx, points);
  orb_free(ctx, rotations);
  orb_free(ctx, means);
  orb_free(ctx, shapes);
  return status;
}
