/* The values of every parameter of the composed map: `fast` and `default` first, then what `quality` changes. */
#include "align/map/engine/params.h"

#include <math.h>

static const orb_map_params DEFAULTS = {
    .energy = {.near_isometry = 1.05, .good = 1.2, .poor = 1.45, .caught = 2, .cap = 20},
    .work = {.all = 550,
             .given_up = 90,
             .untwisted = 250,
             .untwist = 450,
             .passes = 3,
             .pass_gain = 0.99,
             .far_above = 1.5,
             .rough = 1},
    .swap = {.share = 1e-3, .ratio = 2},
    .level = {.spatial = 8000,
              .mapped = 16000,
              .last = 60000,
              .kept = 300,
              .kept_each = 4,
              .growth = 1.5,
              .last_growth = 1.2,
              .first_sweeps = 150,
              .coarse_sweeps = 60,
              .level_sweeps = 40,
              .final_sweeps = 60,
              .rough_sweeps = 40,
              .coarse = 3000,
              .new_steps = 3,
              .pull = 0.5,
              .pull_fall = 0.5},
    .sweep = {.still = 1e-3, .still_share = 500, .over = 1.5},
    .step = {.tries = 8, .shrink = 0.2, .shorten = 0.4, .sufficient = 1e-4, .convexity = 0.05, .least_slope = 1e-12},
    .star = {.epsilon = 0.1, .hinge = 0.1, .upright = 0.3, .mollify = 1e-3},
    .clear = {.hopeless = 9,
              .rounds = 8,
              .sweeps = 20,
              .first_barrier = 1e-4,
              .barrier_growth = 3,
              .flip_growth = 1.05,
              .loosen_rounds = 3},
    .untangle = {.rounds = 60, .stale = 12, .passes = 6, .rings_most = 5, .few = 12, .tries = 6, .shorten = 0.4},
    .draw = {.rounds = 5, .sweeps = 40, .clearings = 8, .pull = 20, .fall = 0.8},
    .near = {.few = 30,
             .rings = 12,
             .usable_rings = 4,
             .clearings = 12,
             .home_rounds = 12,
             .home_sweeps = 20,
             .home_pull = 5},
    .walk = {.samples = 25,
             .usable_samples = 100,
             .least_each = 8,
             .level = 300,
             .level_each = 6,
             .off_surface = 2,
             .facing = 0.7,
             .apart = 0.15,
             .usable_apart = 0.04},
    .mirror = {.few_samples = 50,
               .first_steps = 6,
               .steps = 12,
               .symmetric = 0.02,
               .hopeless = 0.06,
               .settled = 1e-5,
               .same = 0.95,
               .alike = 0.9,
               .middle = 0.025,
               .off_surface = 0.04,
               .taken = 0.05},
    .registration = {.samples = 150,
                     .rounds = 20,
                     .first_controls = 30,
                     .last_controls = 300,
                     .first_stiffness = 1,
                     .last_stiffness = 0.02,
                     .exact_stiffness = 1e-6,
                     .sample_stiffness = 0.1,
                     .least_anchors = 4,
                     .rigid_samples = 150,
                     .rigid_steps = 20,
                     .rigid_cap = 4,
                     .fixed_search = 50000,
                     .normal_weight = 0.25,
                     .facing = 0.2,
                     .far = 3,
                     .least_controls = 8,
                     .slide = 0.05},
    .place = {.facing = 0.5, .normal_weight = 0.25, .search = 40000, .jitter = 0.3},
    .twist = {.rotated = 80 * M_PI / 180,
              .twisted = 90 * M_PI / 180,
              .smallest = 5e-4,
              .largest = 0.2,
              .band_vertices = 6,
              .bands = 3,
              .growth = 40,
              .wider = 1.8,
              .solve_steps = 1000,
              .solve_settled = 1e-9,
              .least_weight = 0.05},
    .untwist = {.early_energy = 2,
                .early_kept = 0.9,
                .steps = 8,
                .step_sweeps = 10,
                .descents = 6,
                .gain = 2e-3,
                .kept_gain = 3e-3}};

orb_map_params orb_map_params_of(orb_preset preset) {
  const double soft_below = 0.05;
  orb_map_params p = DEFAULTS;
  p.star.soft_below = soft_below;
  p.star.soft_value = soft_below - 1 - log(soft_below);
  if (preset == ORB_PRESET_QUALITY) {
    p.work.all = 5000;
    p.work.passes = 6;
    p.work.rough = 0;
    p.level.growth = 1.3;
    p.level.first_sweeps = 300;
    p.level.coarse_sweeps = 120;
    p.level.level_sweeps = 80;
    p.level.final_sweeps = 120;
  }
  return p;
}
