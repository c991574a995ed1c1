#include "embed/newton/advance.h"

#include <math.h>

#include "base/check.h"
#include "base/context.h"
#include "base/loops.h"
#include "embed/newton/level.h"
#include "embed/newton/multires.h"
#include "embed/newton/place.h"
#include "embed/newton/refiner.h"
#include "embed/newton/relax.h"

enum { SWEEP_GRAIN = 32 }; /* batches of a chunk */

/* Factor on the Newton steps of every sweep of a level but the first. */
static const double OVER_RELAXATION = 1.9;

static double blend_of(const orb_refiner *r) {
  return r->live == r->hierarchy->surface.vertex_count ? r->settings.finest : r->settings.blend;
}

typedef struct sweep_loop {
  const orb_level *level;
  orb_sweep_job job;
  int32_t start;
} sweep_loop;

static void sweep_batches(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  const sweep_loop *loop = arg;
  loop->level->loops->sweep(&loop->job, loop->start + begin, loop->start + end);
}

/* Relaxes the vertices that the vector sweep left over. */
static orb_status relax_left_over(orb_context *ctx, orb_refiner *r, int32_t begin, int32_t end, double blend) {
  const orb_level *level = &r->level;
  for (int32_t b = begin; b < end; b++) {
    for (int l = 0; level->batch_stiff[b] >> l; l++) {
      if (level->batch_stiff[b] >> l & 1) {
        double gain;
        ORB_TRY(
            orb_refiner_relax(ctx, r, level->batch_vertex[(int64_t)b * level->loops->lanes + l], blend, &gain, NULL));
      }
    }
  }
  return ORB_OK;
}

/* About the reciprocal of a mean edge on the sphere: a power of two, so that scaling rounds nothing. */
static double scale_of(const orb_refiner *r) {
  return exp2(round(0.5 * log2(r->live / 14.5)));
}

/* One sweep; *energy: of the level before it (each triangle lies in three stars), *fall: by how much it fell. Sums are
 * taken in the order of batches. */
static orb_status sweep_once(orb_context *ctx, orb_refiner *r, double relax, double *energy, double *fall) {
  orb_level *level = &r->level;
  double blend = blend_of(r);
  sweep_loop loop = {.level = level,
                     .job = {.point = r->point,
                             .vertex = level->batch_vertex,
                             .fill = level->batch_fill,
                             .count = level->lane_valence,
                             .valence = level->batch_valence,
                             .offset = level->batch_offset,
                             .ring = level->ring,
                             .shape = level->shape,
                             .weight = orb_refiner_energy(r),
                             .relax = relax,
                             .scale = scale_of(r),
                             .energy = level->batch_energy,
                             .fall = level->batch_fall,
                             .stiff = level->batch_stiff}};
  *energy = *fall = 0;
  for (int q = 0; q < level->colours; q++) {
    int32_t begin = level->batch_start[q], end = level->batch_start[q + 1];
    loop.start = begin;
    ORB_TRY(orb_sliced_for(ctx, end - begin, SWEEP_GRAIN, sweep_batches, &loop));
    ORB_TRY(relax_left_over(ctx, r, begin, end, blend));
    for (int32_t b = begin; b < end; b++) {
      *energy += level->batch_energy[b];
      *fall += level->batch_fall[b];
    }
  }
  *energy /= 3;
  for (int32_t i = 0; i < level->heavy_count; i++) {
    double gain;
    ORB_TRY(orb_refiner_relax(ctx, r, level->heavy[i], blend, &gain, NULL));
  }
  return ORB_OK;
}

static orb_status need_level(orb_context *ctx, orb_refiner *r) {
  if (r->level.valid) {
    return ORB_OK;
  }
  return orb_level_build(ctx, &r->level, r->hierarchy->loops, &r->hierarchy->surface, r->alive, r->pinned, r->live,
                         blend_of(r));
}

orb_status orb_refiner_sweep(orb_context *ctx, orb_refiner *r, int32_t sweeps, double *gain) {
  ORB_TRY(need_level(ctx, r));
  double energy = 1, fall = 0;
  for (int32_t i = 0; i < sweeps; i++) {
    ORB_TRY(sweep_once(ctx, r, i == 0 ? 1.0 : OVER_RELAXATION, &energy, &fall));
  }
  if (gain) {
    *gain = energy > 0 ? fall / energy : 0;
  }
  return ORB_OK;
}

/* The share of the energy that a sweep must gain for another to follow. */
static double least_gain(const orb_refiner *r) {
  const orb_newton_settings *set = &r->settings;
  int64_t n = r->hierarchy->surface.vertex_count;
  return r->live == n ? set->settled_last : r->live * (int64_t)ORB_NEWTON_FAR < n ? set->settled_far : set->settled;
}

/* Sweeps a level that has just been reached: often if it is coarse, where sweeps are cheap and decide most. A sweep
 * that gains almost nothing ends the level; sweeps are added while each still gains much. Over-relaxed sweeps leave
 * neighbours on either side of their places, so the last sweep of the finest level is not over-relaxed. */
static orb_status settle_level(orb_context *ctx, orb_refiner *r) {
  const orb_newton_settings *set = &r->settings;
  int32_t n = r->hierarchy->surface.vertex_count;
  int last = r->live == n;
  int32_t sweeps = r->live < set->coarse_until ? set->coarse_sweeps : last ? set->final_sweeps : set->level_sweeps;
  double energy, fall;
  ORB_TRY(need_level(ctx, r));
  for (int32_t i = 0; i < sweeps; i++) {
    ORB_TRY(sweep_once(ctx, r, i == 0 ? 1.0 : OVER_RELAXATION, &energy, &fall));
    if (last) {
      orb_progress(ctx, "embed", 0.6 + 0.4 * (i + 1) / sweeps);
    }
    if (i > 1 && fall < least_gain(r) * energy) {
      break;
    }
    if (i == sweeps - 1 && fall > (last ? set->converged_last : set->converged) * energy && sweeps < set->most_sweeps) {
      sweeps++;
    }
  }
  return last ? sweep_once(ctx, r, 1.0, &energy, &fall) : ORB_OK;
}

/* Frees what only collapses need, once all are undone for good. */
static void drop_collapses(orb_context *ctx, orb_refiner *r) {
  orb_hierarchy *h = r->hierarchy;
  orb_free(ctx, h->log);
  orb_free(ctx, h->area_log);
  orb_free(ctx, h->surface.position4);
  orb_free(ctx, r->crowding);
  h->log = NULL;
  h->area_log = h->surface.position4 = r->crowding = NULL;
}

orb_status orb_refiner_advance(orb_context *ctx, orb_refiner *r, int32_t vertices) {
  int32_t n = r->hierarchy->surface.vertex_count;
  vertices = vertices < n ? vertices : n;
  while (r->live < vertices) {
    double growth = r->live >= r->settings.fine_from ? r->settings.growth_fine : r->settings.growth;
    double next = r->live < 8 ? 8 : r->live * growth + 1;
    next = next > n / 1.3 ? n : next;
    int32_t stop = next < vertices ? (int32_t)next : vertices;
    double blend = stop == n ? r->settings.finest : r->settings.blend;
    while (r->live < stop) {
      ORB_TRY(orb_refiner_undo_round(ctx, r, blend));
      orb_progress(ctx, "embed", 0.6 * r->live / n);
    }
    if (r->one_way && r->live == n) {
      drop_collapses(ctx, r);
    }
    ORB_TRY(settle_level(ctx, r));
  }
  return ORB_OK;
}
