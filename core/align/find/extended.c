#include "align/find/extended.h"

#include <math.h>
#include <string.h>

#include "align/find/agreed.h"
#include "base/check.h"
#include "base/memory.h"
#include "base/tasks.h"

/* Trials that are extended side by side. */
typedef struct chains {
  orb_trials *t;
  double most; /* cost of a trial that is extended again */
  int rounds;
} chains;

/* Copies the positions of a trial. `out` has maps of its own, still to be filled, and no cost. */
static orb_status copy_trial(orb_context *ctx, const orb_trials *t, const orb_trial *one, orb_trial *out) {
  ORB_TRY(orb_trial_create(ctx, t, out));
  for (int s = 0; s < 2; s++) {
    const size_t n = (size_t)t->copy[s].mesh.vertex_count;
    memcpy(out->pose[s].position, one->pose[s].position, 3 * n * sizeof(double));
  }
  return ORB_OK;
}

/* Extends a trial and registers it along the new map. *extended 0: it agrees on too little, and stays. */
static orb_status extend(orb_context *ctx, const orb_trials *t, orb_agreed *agreed, orb_trial *one, double inner,
                         int *extended) {
  const double *const position[2] = {one->pose[0].position, one->pose[1].position};
  ORB_TRY(orb_agreed_extend(ctx, agreed, position, inner, one->own[0], one->own[1], extended));
  if (!*extended) {
    return ORB_OK;
  }
  ORB_TRY(orb_trial_register_both(ctx, t, one));
  orb_trial_fill_cost(t, one, 2);
  return ORB_OK;
}

/* Extends one trial again and again. An extension may cost a little more than the one before, since the next one may
 * cost less than both. */
static orb_status run_chain(orb_context *ctx, void *arg, int32_t i) {
  const chains *all = arg;
  orb_trials *t = all->t;
  orb_trial *best = &t->trial[i], next = {0}, last = {0};
  const orb_mesh *const mesh[2] = {&t->copy[0].mesh, &t->copy[1].mesh};
  const orb_survey *const survey[2] = {&t->survey[0], &t->survey[1]};
  orb_agreed agreed = {0};
  orb_status status;
  int extended = 1;
  if (!(best->cost < INFINITY)) {
    return ORB_OK; /* it was dropped */
  }
  ORB_GO(status, orb_agreed_create(ctx, mesh, survey, &agreed), end);
  ORB_GO(status, copy_trial(ctx, t, best, &next), end);
  for (int round = 0; round < all->rounds; round++) {
    ORB_GO(status, extend(ctx, t, &agreed, &next, round == 0 ? ORB_FIND_AGREED_INNER : 1, &extended), end);
    if (!extended) {
      break;
    }
    const double cost = next.cost;
    if (next.cost < best->cost) {
      ORB_GO(status, copy_trial(ctx, t, &next, &last), end);
      orb_trial_free(ctx, best);
      *best = next;
      next = last;
      last = (orb_trial){0};
    }
    if (cost > all->most) {
      break;
    }
  }
end:
  orb_trial_free(ctx, &next);
  orb_trial_free(ctx, &last);
  orb_agreed_free(ctx, &agreed);
  return status;
}

orb_status orb_trials_extend(orb_trials *t) {
  const orb_trial *best = &t->trial[orb_trials_best(t)];
  chains all = {.t = t};
  if (!orb_trials_bend_much(t)) {
    return ORB_OK;
  }
  all.most = ORB_FIND_EXTENDS_BEHIND * best->cost;
  all.rounds = orb_trials_are_symmetric(t) ? ORB_FIND_EXTENSIONS_MIRRORED : ORB_FIND_EXTENSIONS;
  return orb_tasks_run(t->ctx, t->count, run_chain, &all);
}
