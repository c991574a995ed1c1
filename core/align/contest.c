#include "align/contest.h"

#include <math.h>

#include "align/find/params.h"
#include "align/map/compose.h"
#include "align/map/engine/params.h"
#include "base/check.h"
#include "base/memory.h"
#include "base/tasks.h"

typedef struct contest {
  orb_match *match;
  orb_alignment *alignment;
  orb_preset preset;
  double *target; /* of the next best match */
  orb_draft *draft[2];
  double energy[2];
} contest;

int orb_contest_is_open(const orb_match *match, int keep_angles) {
  return keep_angles && match->is_found && match->bend > ORB_FIND_WALKS_FIRST && match->other_count > 0 &&
         match->other[0].cost <= ORB_FIND_OTHER_BEHIND;
}

/* Walks towards the best match (0) or the next best one (1). */
static orb_status walk(orb_context *ctx, void *arg, int32_t i) {
  contest *c = arg;
  ORB_TRY(i == 0 ? orb_match_aim(ctx, c->match) : orb_match_other_target(ctx, c->match, 0, &c->target));
  return orb_draft_create(ctx, &c->alignment->shapes[0], &c->alignment->shapes[1], i ? c->target : c->match->target, 1,
                          c->preset, &c->draft[i], &c->energy[i]);
}

/* Walks towards one match differ by a tenth of what they exceed 1 by, so less does not tell two matches apart. */
static int next_wins(const double energy[2]) {
  return energy[1] < INFINITY && energy[1] - 1 < ORB_FIND_CONTEST_GAIN * (energy[0] - 1);
}

orb_status orb_contest_run(orb_context *ctx, orb_match *match, orb_preset preset, orb_alignment *alignment,
                           double **target, double *clear) {
  contest c = {.match = match, .alignment = alignment, .preset = preset};
  orb_status status;
  *target = NULL;
  ORB_GO(status, orb_tasks_run(ctx, 2, walk, &c), end);
  const int winner = next_wins(c.energy);
  orb_draft_free(ctx, c.draft[1 - winner]);
  c.draft[1 - winner] = NULL;
  ORB_GO(status, orb_draft_finish(ctx, c.draft[winner], &alignment->energy), end);
  if (winner == 1) {
    *clear = fmax(0, 1 - c.energy[1] / fmin(c.energy[0], orb_map_params_of(preset).energy.poor));
    *target = c.target;
    c.target = NULL;
  }
end:
  orb_draft_free(ctx, c.draft[0]);
  orb_draft_free(ctx, c.draft[1]);
  orb_free(ctx, c.target);
  return status;
}
