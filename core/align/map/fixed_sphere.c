#include "align/map/fixed_sphere.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"

/* Builds the surface at the points that run->fixed_points says. */
static orb_status rebuild(orb_map_run *c) {
  orb_aligned_shape shape = {.mesh = c->fixed->mesh, .points = c->fixed_points ? c->fixed_points : c->fixed->points};
  orb_map_surface b;
  orb_map_packed packed;
  ORB_TRY(orb_map_surface_create(c->ctx, &shape, &b));
  orb_status status = orb_map_packed_create(c->ctx, &c->fixed->mesh, &b, &packed);
  if (status != ORB_OK) {
    orb_map_surface_free(c->ctx, &b);
    return status;
  }
  orb_map_surface_free(c->ctx, &c->b);
  orb_map_packed_free(c->ctx, &c->packed);
  c->b = b;
  c->packed = packed;
  return ORB_OK;
}

orb_status orb_map_take_sphere(orb_map_run *c, const double *points) {
  size_t n = 3 * (size_t)c->fixed->mesh.vertex_count, size = n * sizeof(double);
  const double *given = c->fixed->points, *now = c->fixed_points ? c->fixed_points : given;
  if (memcmp(now, points ? points : given, size) == 0) {
    return ORB_OK;
  }
  double *best = ORB_NEW(c->ctx, double, 3 * (size_t)c->vertex_count), *copy = NULL;
  if (points) {
    copy = ORB_NEW(c->ctx, double, n);
  }
  if (!best || (points && !copy)) {
    orb_free(c->ctx, best);
    orb_free(c->ctx, copy);
    return ORB_E_NO_MEMORY;
  }
  if (points) {
    memcpy(copy, points, size);
  }
  orb_map_candidate now_best = {c->best, c->fixed_points, c->best_energy};
  int keeps = !c->kept.points || now_best.energy < c->kept.energy;
  orb_map_candidate dropped = keeps ? c->kept : now_best;
  c->kept = keeps ? now_best : c->kept;
  orb_free(c->ctx, dropped.points);
  orb_free(c->ctx, dropped.fixed);
  c->best = best;
  c->best_energy = INFINITY;
  c->fixed_points = copy;
  return rebuild(c);
}

orb_status orb_map_take_best(orb_map_run *c) {
  if (!c->kept.points || c->kept.energy > c->best_energy) {
    return ORB_OK;
  }
  orb_map_candidate best = c->kept;
  orb_free(c->ctx, c->best);
  orb_free(c->ctx, c->fixed_points);
  c->best = best.points;
  c->fixed_points = best.fixed;
  c->best_energy = best.energy;
  c->kept = (orb_map_candidate){0};
  return rebuild(c);
}
