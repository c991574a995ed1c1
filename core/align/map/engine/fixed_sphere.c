#include "align/map/engine/fixed_sphere.h"

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

orb_status orb_map_take_sphere(orb_map_run *c, double **points) {
  size_t n = 3 * (size_t)c->vertex_count;
  double *best = ORB_NEW(c->ctx, double, n);
  if (!best) {
    return ORB_E_NO_MEMORY;
  }
  ORB_ASSERT(!c->kept.points);
  memcpy(best, c->start, n * sizeof *best);
  c->kept = (orb_map_candidate){c->best, c->fixed_points, c->best_energy};
  c->best = best;
  c->best_energy = INFINITY;
  c->fixed_points = *points;
  *points = NULL;
  return rebuild(c);
}

orb_status orb_map_take_best(orb_map_run *c) {
  if (!c->kept.points || c->kept.energy > c->best_energy) {
    return ORB_OK;
  }
  orb_free(c->ctx, c->best);
  orb_free(c->ctx, c->fixed_points);
  c->best = c->kept.points;
  c->fixed_points = c->kept.fixed;
  c->best_energy = c->kept.energy;
  c->kept = (orb_map_candidate){0};
  return rebuild(c);
}
