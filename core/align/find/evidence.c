#include "align/find/evidence.h"

#include <math.h>

#include "align/find/params.h"
#include "numeric/rotation.h"
#include "numeric/vec3.h"

double orb_evidence_rotated(const orb_mesh *copy, const double *pose) {
  const double *x = copy->positions;
  double mean[2][3] = {{0}}, h[9] = {0}, r[9] = {0};
  for (int32_t v = 0; v < copy->vertex_count; v++) {
    for (int k = 0; k < 3; k++) {
      mean[0][k] += x[3 * (size_t)v + (size_t)k] / copy->vertex_count;
      mean[1][k] += pose[3 * (size_t)v + (size_t)k] / copy->vertex_count;
    }
  }
  for (int32_t v = 0; v < copy->vertex_count; v++) {
    double p[3], q[3];
    orb_sub(x + 3 * (size_t)v, mean[0], p);
    orb_sub(pose + 3 * (size_t)v, mean[1], q);
    orb_add_outer(h, q, p, 1);
  }
  (void)orb_nearest_rotation(h, r);
  return acos(fmin(1, fmax(-1, (r[0] + r[4] + r[8] - 1) / 2))) / M_PI;
}

double orb_evidence_resized(const orb_mesh *copy, const double *pose) {
  double sum = 0, all = 0;
  for (int32_t t = 0; t < copy->triangle_count; t++) {
    const int32_t *v = copy->triangles + 3 * (size_t)t;
    const double here = orb_triangle_area_at(copy->positions, v), there = orb_triangle_area_at(pose, v);
    sum += here * fabs(log(fmax(there, ORB_FIND_RESIZED_LEAST) / fmax(here, ORB_FIND_RESIZED_LEAST)));
    all += here;
  }
  return all > 0 ? sum / all : 0;
}

/* The normal of triangle t, of length 1. Returns its area; 0: it has no normal. */
static double normal_of(const orb_mesh *mesh, int32_t t, double n[3]) {
  orb_triangle_normal_at(mesh->positions, mesh->triangles + 3 * (size_t)t, n);
  return 0.5 * orb_normalize(n);
}

double orb_evidence_scattered(const orb_mesh *copy, const double *pose, const orb_mesh *other,
                              const orb_nearest *tree) {
  double h[9] = {0}, r[9] = {0}, all = 0, alike = 0;
  for (int32_t t = 0; t < copy->triangle_count; t++) {
    const int32_t *v = copy->triangles + 3 * (size_t)t;
    double here[3], there[3], middle[3];
    orb_place place;
    for (int k = 0; k < 3; k++) {
      middle[k] = (pose[3 * (size_t)v[0] + (size_t)k] + pose[3 * (size_t)v[1] + (size_t)k] +
                   pose[3 * (size_t)v[2] + (size_t)k]) /
                  3;
    }
    (void)orb_nearest_query(tree, middle, INFINITY, &place);
    const double area = normal_of(copy, t, here);
    if (place.triangle >= 0 && area > 0 && normal_of(other, place.triangle, there) > 0) {
      orb_add_outer(h, there, here, area);
      all += area;
    }
  }
  if (!(all > 0) || !orb_nearest_rotation(h, r)) {
    return 0;
  }
  for (int k = 0; k < 9; k++) {
    alike += r[k] * h[k];
  }
  return fmax(0, 1 - alike / all); /* rounding */
}
