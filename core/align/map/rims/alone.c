#include "align/map/rims/alone.h"

#include <math.h>

#include "base/check.h"
#include "mesh/holes.h"
#include "numeric/rotation.h"
#include "numeric/vec3.h"

enum { SAMPLES = 96 }; /* of a rim: a multiple of ORB_RIMS_ALONE, and 4° apart on a circle */

typedef struct rim {
  orb_place place[SAMPLES];
  double at[SAMPLES][3]; /* around their mean, of mean squared length 1 */
} rim;

/* Even samples of a rim. */
static void sample(const orb_mesh *mesh, const orb_hole_list *holes, const orb_hole *hole, rim *out) {
  double mean[3] = {0, 0, 0}, size = 0;
  int32_t k = 0;
  for (int i = 0; i < SAMPLES; i++) {
    const double s = hole->length * i / SAMPLES;
    while (k + 1 < hole->count && holes->at[hole->start + k + 1] <= s) {
      k++;
    }
    const double begin = holes->at[hole->start + k];
    const double end = k + 1 < hole->count ? holes->at[hole->start + k + 1] : hole->length;
    const double t = end > begin ? (s - begin) / (end - begin) : 0;
    out->place[i] = orb_place_on_half_edge(holes->half_edges[hole->start + k], t);
    orb_place_position(mesh, &out->place[i], out->at[i]);
    for (int c = 0; c < 3; c++) {
      mean[c] += out->at[i][c] / SAMPLES;
    }
  }
  for (int i = 0; i < SAMPLES; i++) {
    orb_sub(out->at[i], mean, out->at[i]);
    size += orb_dot(out->at[i], out->at[i]) / SAMPLES;
  }
  for (int i = 0; i < 3 * SAMPLES; i++) {
    out->at[i / 3][i % 3] /= size > 0 ? sqrt(size) : 1;
  }
}

/* How badly the rims fit if sample i of the first one goes to sample i + shift of the second one. */
static double cost_of(double rotation_cost, const rim rims[2], int shift) {
  double h[9] = {0}, r[9], sum = 0;
  for (int i = 0; i < SAMPLES; i++) {
    orb_add_outer(h, rims[0].at[i], rims[1].at[(i + shift) % SAMPLES], 1);
  }
  if (!orb_nearest_rotation(h, r)) {
    return INFINITY;
  }
  for (int i = 0; i < SAMPLES; i++) {
    const double *p = rims[1].at[(i + shift) % SAMPLES], *q = rims[0].at[i];
    for (int c = 0; c < 3; c++) {
      const double off = r[3 * c] * p[0] + r[3 * c + 1] * p[1] + r[3 * c + 2] * p[2] - q[c];
      sum += off * off / SAMPLES;
    }
  }
  const double angle = acos(fmin(fmax(0.5 * (r[0] + r[4] + r[8] - 1), -1), 1)) / M_PI;
  return sum + rotation_cost * angle * angle;
}

/* The only hole of a list; NULL: there is none, or there are several. */
static const orb_hole *only(const orb_hole_list *holes) {
  return holes->count == 1 && holes->of[0].is_simple && holes->of[0].length > 0 ? holes->of : NULL;
}

orb_status orb_rims_alone(orb_context *ctx, const orb_map_params *params, const orb_align_shape shapes[2],
                          orb_place at[2 * ORB_RIMS_ALONE], int *found) {
  orb_hole_list holes[2] = {0};
  rim rims[2];
  orb_status status;
  *found = 0;
  ORB_GO(status, orb_holes_find(ctx, shapes[0].mesh, &holes[0]), done);
  ORB_GO(status, orb_holes_find(ctx, shapes[1].mesh, &holes[1]), done);
  if (!only(&holes[0]) || !only(&holes[1])) {
    goto done;
  }
  int best = 0;
  double least = INFINITY;
  for (int s = 0; s < 2; s++) {
    sample(shapes[s].mesh, &holes[s], only(&holes[s]), &rims[s]);
  }
  for (int shift = 0; shift < SAMPLES; shift++) {
    const double cost = cost_of(params->rims.rotation_cost, rims, shift);
    best = cost < least ? shift : best;
    least = fmin(least, cost);
  }
  for (int i = 0; i < ORB_RIMS_ALONE; i++) {
    const int k = i * (SAMPLES / ORB_RIMS_ALONE);
    at[2 * i] = rims[0].place[k];
    at[2 * i + 1] = rims[1].place[(k + best) % SAMPLES];
  }
  *found = 1;
done:
  orb_holes_free(ctx, &holes[0]);
  orb_holes_free(ctx, &holes[1]);
  return status;
}
