#include "align/map/twist/bands.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "numeric/rotation.h"
#include "numeric/vec3.h"

static const double NOT_PARALLEL = 0.7; /* cosine: an axis at a greater angle is far from parallel to the limb's */

/* A ring of a limb. */
typedef struct band {
  double height, from[3], to[3], rotation[9];
} band;

typedef struct ranked {
  double height;
  int32_t vertex;
} ranked;

static int by_height(const void *a, const void *b) {
  const ranked *x = a, *y = b;
  return x->height != y->height ? (x->height > y->height) - (x->height < y->height)
                                : (x->vertex > y->vertex) - (x->vertex < y->vertex);
}

/* The centres of a band's vertices on both shapes, and the rotation between them. */
static int fit_band(const orb_map_surface *b, const double *back, const ranked *list, int32_t count, band *out) {
  double h[9] = {0};
  memset(out, 0, sizeof *out);
  for (int32_t i = 0; i < count; i++) {
    const double *y = b->x + 3 * (size_t)list[i].vertex, *x = back + 3 * (size_t)list[i].vertex;
    out->height += list[i].height / count;
    for (int k = 0; k < 3; k++) {
      out->from[k] += x[k] / count;
      out->to[k] += y[k] / count;
    }
  }
  for (int32_t i = 0; i < count; i++) {
    double x[3], y[3];
    orb_sub(back + 3 * (size_t)list[i].vertex, out->from, x);
    orb_sub(b->x + 3 * (size_t)list[i].vertex, out->to, y);
    orb_add_outer(h, y, x, 1);
  }
  return orb_nearest_rotation(h, out->rotation);
}

/* The angle by which one band is rotated against another, around the axis between them. */
static double rotation_between(const band *low, const band *high) {
  double axis[3], e[3], f[3], d[9], cosine = 0, sine = 0;
  const double any[3] = {1, 0, 0}, other[3] = {0, 1, 0};
  orb_sub(high->to, low->to, axis);
  if (!(orb_normalize(axis) > 0)) {
    return 0;
  }
  orb_cross(axis, fabs(axis[0]) < NOT_PARALLEL ? any : other, e);
  orb_normalize(e);
  orb_cross(axis, e, f);
  for (int k = 0; k < 9; k++) {
    d[k] = orb_dot(high->rotation + 3 * (k / 3), low->rotation + 3 * (k % 3));
  }
  for (int k = 0; k < 9; k++) {
    cosine += d[k] * (e[k / 3] * e[k % 3] + f[k / 3] * f[k % 3]);
    sine += d[k] * (f[k / 3] * e[k % 3] - e[k / 3] * f[k % 3]);
  }
  return atan2(sine, cosine);
}

/* Lists the vertices of the limb, of the ring around it and of the first ring of its end, by height. Returns how many
 * there are. *rim: how many are around it. */
static int32_t rank(orb_map_patch *patch, const double *height, ranked *list, int32_t *rim) {
  int32_t count = 0;
  *rim = 0;
  orb_map_patch_find_rim(patch);
  (void)orb_map_patch_dilate(patch);
  for (int32_t v = 0; v < patch->b->vertex_count; v++) {
    if (patch->next[v] && (patch->inside[v] != ORB_PATCH_END || patch->reached[v])) {
      list[count++] = (ranked){patch->inside[v] ? height[v] : 0, v};
      *rim += !patch->inside[v];
    }
  }
  qsort(list, (size_t)count, sizeof *list, by_height);
  return count;
}

orb_status orb_map_bands_measure(const orb_map_params *params, orb_map_patch *patch, const double *height,
                                 const double *back, orb_map_twist *out) {
  int32_t rim;
  band low, high;
  ranked *list = ORB_NEW(patch->ctx, ranked, patch->b->vertex_count);
  if (!list) {
    return ORB_E_NO_MEMORY;
  }
  const int32_t n = rank(patch, height, list, &rim);
  int32_t bands = (n - rim) / params->twist.band_vertices, wanted = bands < ORB_MAP_BANDS ? bands : ORB_MAP_BANDS;
  int fine = wanted >= params->twist.bands && fit_band(patch->b, back, list, rim, &low);
  out->height[0] = out->angle[0] = 0;
  for (int32_t k = 0; k < wanted && fine; k++) {
    int32_t begin = rim + (int32_t)((int64_t)(n - rim) * k / wanted);
    int32_t end = rim + (int32_t)((int64_t)(n - rim) * (k + 1) / wanted);
    fine = fit_band(patch->b, back, list + begin, end - begin, &high);
    out->height[k + 1] = high.height;
    out->angle[k + 1] = out->angle[k] + rotation_between(&low, &high);
    low = high;
  }
  out->count = fine ? (int)wanted + 1 : 0;
  orb_free(patch->ctx, list);
  return ORB_OK;
}
