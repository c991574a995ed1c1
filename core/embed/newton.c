/* The method `newton`: presets, and the run from mesh to points. */
#include "embed/newton.h"

#include "base/check.h"
#include "embed/multires.h"

void orb_newton_settings_of(const orb_embed_options *options, orb_newton_settings *out) {
  *out = (orb_newton_settings){.growth = 1.5,
                               .growth_fine = 2.2,
                               .fine_from = 20000,
                               .coarse_until = 5000,
                               .coarse_sweeps = 200,
                               .level_sweeps = 6,
                               .final_sweeps = 14,
                               .most_sweeps = 400,
                               .converged = 1e-3,
                               .converged_last = 1e-3,
                               .settled = 1e-4,
                               .settled_last = 1e-6,
                               .weight = options->energy_weight,
                               .blend = 0.5,
                               .finest = 1e-7,
                               .crowded = 40};
  if (options->preset == ORB_PRESET_FAST) {
    out->growth_fine = 3;
    out->fine_from = 10000;
    out->coarse_until = 2500;
    out->level_sweeps = 3;
    out->final_sweeps = 6;
    out->converged = out->converged_last = 5e-3;
    out->settled = 5e-4;
  } else if (options->preset == ORB_PRESET_QUALITY) {
    out->growth_fine = 1.7;
    out->coarse_until = 100000;
    out->coarse_sweeps = 600;
    out->level_sweeps = 20;
    out->final_sweeps = 40;
    out->most_sweeps = 1000;
    out->converged = out->converged_last = 2e-4;
    out->settled = 2e-5;
  }
  if (options->energy_weight <
      1) { /* all of the way from w = 1 is made on the finest level: see orb_refiner_weight() */
    out->final_sweeps = out->final_sweeps < 60 ? 60 : out->final_sweeps;
    out->converged_last *= 0.5;
  }
}

orb_status orb_newton_run(orb_context *ctx, const orb_mesh *mesh, const orb_embed_options *options, double *points,
                          orb_embed_timings *timings) {
  orb_hierarchy *hierarchy = NULL;
  orb_refiner *refiner = NULL;
  double start = orb_clock();
  orb_status status;
  ORB_GO(status, orb_hierarchy_create(ctx, mesh, NULL, 0, &hierarchy), done);
  double between = orb_clock();
  timings->simplify = between - start;
  ORB_GO(status, orb_refiner_create(ctx, hierarchy, options, &refiner), done);
  orb_refiner_one_way(refiner);
  ORB_GO(status, orb_refiner_advance(ctx, refiner, mesh->vertex_count), done);
  if (mesh->vertex_count == 4) {
    ORB_GO(status, orb_refiner_sweep(ctx, refiner, 50, NULL), done);
  }
  orb_level_free(ctx, &refiner->level); /* first, so that the points take no more memory than there was */
  orb_refiner_points(refiner, points);
  timings->embed = orb_clock() - between;
done:
  orb_refiner_abandon(ctx, refiner);
  orb_hierarchy_destroy(ctx, hierarchy);
  return status;
}
