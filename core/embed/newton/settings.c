#include "embed/newton/settings.h"

/* The weight of areas beside angles, for embeddings that keep angles. Dimensionless. Of 0.1, 0.03, 0.01, 0.003 and
 * 0.001, which make limbs ever smaller, 0.003 led to the composed maps of least energy on eight pairs of posed people
 * (the half `choose` of tests/bench/correspond.py). With 0.003 the scale of the sphere varies so much within the
 * triangles of a supermesh that places slide by more than 1 % of the diagonal, so the value is a little larger. */
static const double AREA_BESIDE_ANGLES = 0.005;

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
                               .settled = 3e-4,
                               .settled_far = 1e-4,
                               .settled_last = 1e-5,
                               .energy = {.w = options->energy_weight, .area = 1},
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
    out->settled = out->settled_far = 5e-4;
  } else if (options->preset == ORB_PRESET_QUALITY) {
    out->growth_fine = 1.7;
    out->coarse_until = 100000;
    out->coarse_sweeps = 600;
    out->level_sweeps = 20;
    out->final_sweeps = 40;
    out->most_sweeps = 1000;
    out->converged = out->converged_last = 2e-4;
    out->settled = out->settled_far = 2e-5;
    out->settled_last = 1e-6;
  }
  if (options->energy_weight < 1) { /* only the finest level goes below w = 1: see orb_refiner_energy() */
    out->final_sweeps = out->final_sweeps < 60 ? 60 : out->final_sweeps;
    out->converged_last *= 0.5;
  }
}

orb_newton_energy orb_newton_energy_of_angles(void) {
  return (orb_newton_energy){.angle = 1, .area = AREA_BESIDE_ANGLES};
}
