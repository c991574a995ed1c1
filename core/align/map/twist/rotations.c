/* How the map rotates the surroundings of every vertex of the fixed shape in space, and how much area a morph keeps. */
#include <math.h>
#include <string.h>

#include "align/map/twist/rotations.h"
#include "base/check.h"
#include "base/loops.h"
#include "base/memory.h"
#include "numeric/rotation.h"
#include "numeric/vec3.h"

enum { SLICE = 8192 }; /* vertices between checks for cancellation */

typedef struct rotations_run {
  orb_context *ctx;
  const orb_map_surface *b;
  const orb_map_image *map;
  double *back, *rotation;
  orb_locator *locator; /* on the map's points */
} rotations_run;

static void trace_range(void *arg, int64_t begin, int64_t end, int thread) {
  const rotations_run *run = arg;
  const orb_map_image *m = run->map;
  orb_place place = {.triangle = -1};
  (void)thread;
  for (int64_t w = begin; w < end; w++) {
    orb_locate(run->locator, run->b->s + 3 * w, place.triangle, &place);
    const int32_t *v = m->triangles + 3 * (size_t)place.triangle;
    for (int k = 0; k < 3; k++) {
      run->back[3 * w + k] = place.at[0] * m->x[3 * (size_t)v[0] + (size_t)k] +
                             place.at[1] * m->x[3 * (size_t)v[1] + (size_t)k] +
                             place.at[2] * m->x[3 * (size_t)v[2] + (size_t)k];
    }
  }
}

/* Where the vertices of the surface come from. */
static orb_status trace_back(rotations_run *run) {
  const orb_map_image *m = run->map;
  ORB_TRY(
      orb_locator_create(run->ctx, m->points, m->vertex_count, m->triangles, m->triangle_count, NULL, &run->locator));
  orb_status status = orb_sliced_by(run->ctx, run->b->vertex_count, SLICE, 256, trace_range, run);
  orb_locator_destroy(run->ctx, run->locator);
  return status;
}

/* The rotation of the whole shape: of all triangles' centres, weighted by area. */
static void whole_rotation(const rotations_run *run, double rotation[9]) {
  const orb_map_surface *b = run->b;
  double mean[6] = {0}, total = 0, h[9] = {0};
  for (int pass = 0; pass < 2; pass++) {
    for (int32_t t = 0; t < b->triangle_count; t++) {
      const int32_t *v = b->triangles + 3 * (size_t)t;
      double u[3], w[3], n[3], y[3] = {0}, x[3] = {0};
      orb_sub(b->x + 3 * (size_t)v[1], b->x + 3 * (size_t)v[0], u);
      orb_sub(b->x + 3 * (size_t)v[2], b->x + 3 * (size_t)v[0], w);
      orb_cross(u, w, n);
      double area = orb_length(n);
      for (int k = 0; k < 9; k++) {
        y[k % 3] += b->x[3 * (size_t)v[k / 3] + (size_t)k % 3] / 3;
        x[k % 3] += run->back[3 * (size_t)v[k / 3] + (size_t)k % 3] / 3;
      }
      total += pass == 0 ? area : 0;
      for (int k = 0; k < 3; k++) {
        mean[k] += pass == 0 ? area * y[k] : 0;
        mean[3 + k] += pass == 0 ? area * x[k] : 0;
        y[k] -= mean[k];
        x[k] -= mean[3 + k];
      }
      if (pass == 1) {
        orb_add_outer(h, y, x, area);
      }
    }
    for (int k = 0; k < 6 && pass == 0; k++) {
      mean[k] /= total > 0 ? total : 1;
    }
  }
  if (!orb_nearest_rotation(h, rotation)) {
    memset(rotation, 0, 9 * sizeof *rotation);
    rotation[0] = rotation[4] = rotation[8] = 1;
  }
}

/* The area of the mean of both shapes relative to the mean of their areas, after one shape takes the rotation of the
 * whole. A limb that is twisted by half a turn has nearly no area in the mean. */
static double kept_halfway(const rotations_run *run, const double whole[9]) {
  const orb_map_surface *b = run->b;
  double kept = 0, ends = 0;
  for (int32_t t = 0; t < b->triangle_count; t++) {
    const int32_t *v = b->triangles + 3 * (size_t)t;
    double edge[3][2][3], n[3]; /* of the surface, of where it comes from, of their mean */
    for (int i = 0; i < 2; i++) {
      double x[3];
      orb_sub(b->x + 3 * (size_t)v[i + 1], b->x + 3 * (size_t)v[0], edge[0][i]);
      orb_sub(run->back + 3 * (size_t)v[i + 1], run->back + 3 * (size_t)v[0], x);
      for (int k = 0; k < 3; k++) {
        edge[1][i][k] = orb_dot(whole + 3 * k, x);
        edge[2][i][k] = 0.5 * (edge[0][i][k] + edge[1][i][k]);
      }
    }
    for (int s = 0; s < 3; s++) {
      orb_cross(edge[s][0], edge[s][1], n);
      *(s == 2 ? &kept : &ends) += (s == 2 ? 1 : 0.5) * orb_length(n);
    }
  }
  return ends > 0 ? kept / ends : 1;
}

/* The rotation of every vertex's surroundings, from their edges and normals on both shapes. */
static orb_status measure_rotations(rotations_run *run) {
  const orb_map_surface *b = run->b;
  double *sum = ORB_NEW0(run->ctx, double, 16 * (size_t)b->vertex_count);
  if (!sum) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t h = 0; h < 3 * b->triangle_count; h++) {
    size_t v = (size_t)b->triangles[h], q = (size_t)b->triangles[orb_next(h)], r = (size_t)b->triangles[orb_prev(h)];
    double y[2][3], x[2][3], n[3], *s = sum + 16 * v;
    orb_sub(b->x + 3 * q, b->x + 3 * v, y[0]);
    orb_sub(b->x + 3 * r, b->x + 3 * v, y[1]);
    orb_sub(run->back + 3 * q, run->back + 3 * v, x[0]);
    orb_sub(run->back + 3 * r, run->back + 3 * v, x[1]);
    orb_add_outer(s, y[0], x[0], 1);
    s[15] += sqrt(orb_dot(y[0], y[0]) * orb_dot(x[0], x[0]));
    orb_cross(y[0], y[1], n);
    for (int k = 0; k < 3; k++) {
      s[9 + k] += n[k];
    }
    orb_cross(x[0], x[1], n);
    for (int k = 0; k < 3; k++) {
      s[12 + k] += n[k];
    }
  }
  for (int32_t v = 0; v < b->vertex_count; v++) {
    double *s = sum + 16 * (size_t)v, *r = run->rotation + 9 * (size_t)v;
    orb_normalize(s + 9);
    orb_normalize(s + 12);
    orb_add_outer(s, s + 9, s + 12, 0.5 * s[15]);
    if (!orb_nearest_rotation(s, r)) {
      memset(r, 0, 9 * sizeof *r);
    }
  }
  orb_free(run->ctx, sum);
  return orb_context_check(run->ctx);
}

double orb_map_rotations_angle(const double a[9], const double b[9]) {
  double trace = 0;
  int defined[2] = {0, 0};
  for (int k = 0; k < 9; k++) {
    trace += a[k] * b[k];
    defined[0] |= a[k] != 0;
    defined[1] |= b[k] != 0;
  }
  return defined[0] && defined[1] ? acos(fmin(1, fmax(-1, (trace - 1) / 2))) : 0;
}

orb_status orb_map_rotations_measure(orb_context *ctx, const orb_map_surface *b, const orb_map_image *map, double *back,
                                     double *rotation, double whole[9], double *kept) {
  rotations_run run = {.ctx = ctx, .b = b, .map = map, .back = back, .rotation = rotation};
  ORB_TRY(trace_back(&run));
  whole_rotation(&run, whole);
  *kept = kept_halfway(&run, whole);
  return measure_rotations(&run);
}

orb_status orb_map_rotations_kept(orb_context *ctx, const orb_map_surface *b, const orb_map_image *map, double *kept) {
  double whole[9];
  rotations_run run = {.ctx = ctx, .b = b, .map = map, .back = ORB_NEW(ctx, double, 3 * (size_t)b->vertex_count)};
  orb_status status = run.back ? trace_back(&run) : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    whole_rotation(&run, whole);
    *kept = kept_halfway(&run, whole);
  }
  orb_free(ctx, run.back);
  return status;
}
