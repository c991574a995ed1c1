#include "mesh/normals.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "numeric/vec3.h"

/* Adds the triangle's normal to its three vertices, weighted by the angle at each. */
static void add_triangle_normal(const double *positions, const int32_t corner[3], double *normals) {
  double edge[3][3], normal[3];
  for (int k = 0; k < 3; k++) {
    orb_sub(positions + 3 * (int64_t)corner[(k + 1) % 3], positions + 3 * (int64_t)corner[k], edge[k]);
  }
  orb_cross(edge[0], edge[1], normal);
  double twice_area = orb_normalize(normal);
  if (!(twice_area > 0)) {
    return;
  }
  for (int k = 0; k < 3; k++) {
    double angle = atan2(twice_area, -orb_dot(edge[k], edge[(k + 2) % 3]));
    double *sum = normals + 3 * (int64_t)corner[k];
    for (int c = 0; c < 3; c++) {
      sum[c] += angle * normal[c];
    }
  }
}

orb_status orb_smooth_normals(orb_context *ctx, const double *positions, int32_t vertex_count, const int32_t *triangles,
                              int32_t triangle_count, double *out) {
  memset(out, 0, 3 * (size_t)vertex_count * sizeof *out);
  for (int32_t t = 0; t < triangle_count; t++) {
    add_triangle_normal(positions, triangles + 3 * (int64_t)t, out);
    if ((t & 0x3ffff) == 0) {
      ORB_TRY(orb_context_check(ctx));
    }
  }
  for (int32_t v = 0; v < vertex_count; v++) {
    if (!(orb_normalize(out + 3 * (int64_t)v) > 1e-12)) {
      memset(out + 3 * (int64_t)v, 0, 3 * sizeof *out);
    }
  }
  return ORB_OK;
}

void orb_face_normal(const orb_mesh *mesh, int32_t triangle, double out[3]) {
  const int32_t *corner = mesh->triangles + 3 * (int64_t)triangle;
  double u[3], w[3];
  orb_sub(mesh->positions + 3 * (int64_t)corner[1], mesh->positions + 3 * (int64_t)corner[0], u);
  orb_sub(mesh->positions + 3 * (int64_t)corner[2], mesh->positions + 3 * (int64_t)corner[0], w);
  orb_cross(u, w, out);
}
