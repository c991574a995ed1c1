#include "align/map/starts/spectral_samples.h"

#include <math.h>

#include "align/sheet/copy.h"
#include "base/check.h"
#include "numeric/vec3.h"
#include "spectral/spectral.h"

/* How far a spectral map takes the landmarks from their partners, judged by the nearest pair of each, in units of
 * surfaces of area 4π; the distance to that pair is allowed for. */
static double landmarks_away(const orb_map_run *c, const orb_coarse_copy copy[2], const orb_spectral_candidate *map) {
  double sum = 0;
  for (int32_t i = 0; i < c->pairs.landmarks; i++) {
    const double *x = c->x + 3 * (size_t)c->pairs.moving[i], *y = c->b.x + 3 * (size_t)c->pairs.fixed[i];
    double least = INFINITY, away = 0;
    for (int32_t k = 0; k < map->count; k++) {
      double d = sqrt(orb_distance2(x, c->x + 3 * (size_t)copy[0].vertex[map->first[k]]));
      if (d < least) {
        least = d;
        away = sqrt(orb_distance2(y, c->b.x + 3 * (size_t)copy[1].vertex[map->second[k]]));
      }
    }
    sum += fmax(0, away - least);
  }
  return sum / c->pairs.landmarks;
}

static void take(orb_map_run *c, const orb_coarse_copy copy[2], const orb_spectral_candidate *map) {
  for (int32_t k = 0; k < map->count; k++) {
    c->samples.moving[k] = copy[0].vertex[map->first[k]];
    c->samples.fixed[k] = copy[1].vertex[map->second[k]];
  }
  c->samples.count = map->count;
}

orb_status orb_map_spectral_samples(orb_map_run *c) {
  const orb_mesh *mesh[2] = {&c->moving->mesh, &c->fixed->mesh};
  orb_coarse_copy copy[2] = {0};
  orb_spectral_list list;
  double least = c->params.spectral.agrees;
  orb_status status = ORB_OK;
  if (c->pairs.landmarks < c->params.spectral.least_landmarks) {
    return ORB_OK;
  }
  for (int s = 0; s < 2; s++) {
    ORB_GO(status, orb_coarse_copy_create(c->ctx, mesh[s], c->params.spectral.size, &copy[s]), done);
  }
  ORB_GO(status, orb_spectral_find(c->ctx, &copy[0].mesh, &copy[1].mesh, 0, &list), done);
  for (int32_t i = 0; i < list.count; i++) {
    double away = landmarks_away(c, copy, &list.candidate[i]);
    if (away < least) {
      least = away;
      take(c, copy, &list.candidate[i]);
    }
  }
done:
  for (int s = 0; s < 2; s++) {
    orb_coarse_copy_free(c->ctx, &copy[s]);
  }
  return status;
}
