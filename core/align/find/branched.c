#include "align/find/branched.h"

#include "align/find/branches.h"
#include "base/check.h"
#include "base/context.h"
#include "base/tasks.h"

/* Trials that are made side by side. */
typedef struct branching {
  orb_trials *t;
  int32_t first; /* the first new trial */
  orb_tips tips[2];
  orb_branches branches[2];
  orb_tip_match match[ORB_FIND_BRANCHED];
} branching;

static orb_status survey_shape(orb_context *ctx, void *arg, int32_t s) {
  branching *b = arg;
  const orb_trials *t = b->t;
  b->branches[s] = (orb_branches){&t->copy[s], &t->survey[s], &b->tips[s]};
  return orb_tips_find(ctx, &t->copy[s], &t->survey[s], &b->tips[s]);
}

/* Registers a match along its rough map, and again along the images of its poses. Limbs whose lengths differ are drawn
 * off their places at first. */
static orb_status make_one(orb_context *ctx, void *arg, int32_t i) {
  const branching *b = arg;
  const orb_trials *t = b->t;
  orb_trial *one = &b->t->trial[b->first + i];
  orb_status status = ORB_OK;
  ORB_TRY(orb_trial_create(ctx, t, one));
  ORB_TRY(orb_branches_map(ctx, b->branches, &b->match[i], one->own));
  for (int again = 0; again <= ORB_FIND_BRANCHED_AGAIN && status == ORB_OK; again++) {
    for (int s = 0; s < 2 && again > 0; s++) {
      orb_trial_images(t, one, s, one->own[s]);
    }
    status = orb_trial_register_both(ctx, t, one);
    status = status == ORB_OK ? orb_context_check(ctx) : status;
  }
  if (status == ORB_OK) {
    orb_trial_fill_cost(t, one, 2);
  }
  return status;
}

/* Frees new trials that are too far behind, and closes the gaps. */
static void drop_behind(orb_trials *t, int32_t first, double most) {
  int32_t count = first;
  for (int32_t i = first; i < t->count; i++) {
    if (t->trial[i].cost <= most) {
      const orb_trial kept = t->trial[i];
      t->trial[i] = (orb_trial){0};
      t->trial[count++] = kept;
    } else {
      orb_trial_free(t->ctx, &t->trial[i]);
    }
  }
  t->count = count;
}

orb_status orb_trials_branch(orb_trials *t) {
  const double best = t->trial[orb_trials_best(t)].cost;
  branching b = {.t = t, .first = t->count};
  ORB_TRY(orb_tasks_run(t->ctx, 2, survey_shape, &b));
  t->count += orb_branches_match(&b.tips[0], &b.tips[1], ORB_FIND_BRANCHED, b.match);
  ORB_TRY(orb_tasks_run(t->ctx, t->count - b.first, make_one, &b));
  drop_behind(t, b.first, ORB_FIND_BRANCHED_BEHIND * best);
  return ORB_OK;
}
