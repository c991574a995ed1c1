#include "align/map/draft.h"

#include <math.h>

#include "align/map/targets.h"
#include "align/map/twist/untwist.h"
#include "align/map/walked.h"
#include "align/map/whole.h"
#include "base/check.h"
#include "base/memory.h"

struct orb_map_draft {
  orb_map_run run;
  orb_map_walked walked;
  orb_aligned_shape *fixed;
  double energy[2]; /* as of orb_compose() */
};

orb_status orb_map_draft_create(orb_context *ctx, orb_aligned_shape *fixed, orb_aligned_shape *moving,
                                int32_t landmark_count, const double *target, double known, orb_preset preset,
                                orb_map_draft **out, double *energy) {
  const orb_map_guide guide = {.target = target, .keeps_angles = 1, .walks_first = 1, .fits_parts = landmark_count > 0};
  orb_map_draft *d = *out = ORB_NEW0(ctx, orb_map_draft, 1);
  if (!d) {
    return ORB_E_NO_MEMORY;
  }
  d->run = orb_map_run_of(ctx, fixed, moving, 1, landmark_count, &guide, preset);
  d->fixed = fixed;
  ORB_TRY(orb_map_run_open(&d->run, &guide, d->energy));
  d->run.beat.energy = known < INFINITY ? known : 0; /* fewer walks are then tried */
  ORB_TRY(orb_map_target_walks(&d->run, &d->walked));
  d->run.beat.energy = 0;
  *energy = d->walked.energy;
  return ORB_OK;
}

orb_status orb_map_draft_finish(orb_context *ctx, orb_map_draft *d, double *energy) {
  d->run.ctx = ctx;
  d->run.drafted = &d->walked;
  ORB_TRY(orb_map_follow_targets(&d->run));
  *energy = fmin(d->run.best_energy, d->energy[0]);
  return ORB_OK;
}

orb_status orb_map_draft_take(orb_context *ctx, orb_map_draft *d, double *energy, double *loose) {
  orb_map_run *run = &d->run;
  int improved = 0;
  double before = run->best_energy;
  run->ctx = ctx;
  if (!orb_map_run_is_hopeless(run)) {
    if (run->pairs.landmarks > 0) {
      ORB_TRY(orb_map_untwist(run, INFINITY));
      before = run->best_energy;
    }
    ORB_TRY(orb_map_run_fit(run, ORB_MAP_FROM_SPACE, d->energy[0]));
  }
  ORB_TRY(orb_map_run_take(run, d->fixed, d->energy, &improved));
  *energy = d->energy[1];
  *loose = improved ? before : INFINITY;
  return ORB_OK;
}

void orb_map_draft_free(orb_context *ctx, orb_map_draft *d) {
  if (d) {
    d->run.ctx = ctx;
    orb_map_walked_free(&d->run, &d->walked);
    orb_map_run_free(&d->run);
    orb_free(ctx, d);
  }
}
