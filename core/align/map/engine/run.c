#include "align/map/engine/run.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"

orb_status orb_map_full_level(orb_map_run *c, const double *points, const orb_corner_table *s, orb_map_level *level) {
  orb_context *ctx = c->ctx;
  size_t n = (size_t)c->vertex_count;
  unsigned char *flags = ORB_NEW0(ctx, unsigned char, 3 * n); /* alive; pinned; pinned in mesh order */
  if (!flags) {
    return ORB_E_NO_MEMORY;
  }
  memset(flags, 1, n);
  for (int32_t i = 0; i < c->pairs.landmarks; i++) {
    flags[2 * n + (size_t)c->pairs.moving[i]] = 1;
  }
  for (size_t v = 0; v < n; v++) {
    flags[n + v] = flags[2 * n + (size_t)s->to_mesh[v]];
    memcpy(c->position + 3 * v, c->x + 3 * (size_t)s->to_mesh[v], sizeof(double[3]));
  }
  orb_status status =
      orb_map_level_create(ctx, &c->params, s, flags, flags + n, c->position, c->vertex_count, c->local, level);
  for (int32_t v = 0; status == ORB_OK && v < level->count; v++) {
    memcpy(level->x + 3 * (size_t)v, points + 3 * (size_t)s->to_mesh[level->vertex[v]], sizeof(double[3]));
  }
  if (status == ORB_OK) {
    status = orb_map_level_locate_all(ctx, level, &c->b, 1);
  }
  orb_free(ctx, flags);
  return status;
}

void orb_map_allow(orb_map_run *c, int64_t steps) {
  const int64_t least = steps * (int64_t)c->vertex_count;
  c->work = c->work > least ? c->work : least;
}

orb_status orb_map_energy_of(orb_map_run *c, const double *points, double cap, double *energy) {
  orb_corner_table s;
  orb_map_level level = {0};
  ORB_TRY(orb_corner_table_create(c->ctx, &c->moving->mesh, &s));
  orb_status status = orb_map_full_level(c, points, &s, &level);
  if (status == ORB_OK) {
    *energy = orb_map_level_capped_energy(&level, cap);
  }
  orb_map_level_free(c->ctx, &level);
  orb_corner_table_free(c->ctx, &s);
  return status;
}

/* Moves the surface to the points that run->fixed_points says. */
static orb_status move_surface(orb_map_run *c) {
  ORB_TRY(orb_map_surface_move(c->ctx, &c->b, c->fixed_points ? c->fixed_points : c->fixed->points));
  orb_map_packed_move(&c->b, &c->packed);
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
  return move_surface(c);
}

orb_status orb_map_take_best(orb_map_run *c) {
  if (!c->kept.points) {
    return ORB_OK;
  }
  if (c->kept.energy > c->best_energy) {
    orb_free(c->ctx, c->kept.points);
    orb_free(c->ctx, c->kept.fixed);
    c->kept = (orb_map_candidate){0};
    return ORB_OK;
  }
  orb_free(c->ctx, c->best);
  orb_free(c->ctx, c->fixed_points);
  c->best = c->kept.points;
  c->fixed_points = c->kept.fixed;
  c->best_energy = c->kept.energy;
  c->kept = (orb_map_candidate){0};
  return move_surface(c);
}
