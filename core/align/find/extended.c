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
  int32_t trial[ORB_FIND_EXTENDED], count;
  double most; /* cost of a trial that is extended again */
} chains;

static void free_trial(orb_context *ctx, orb_trial *one) {
  for (int s = 0; s < 2; s++) {
    orb_trial_pose_free(ctx, &one->pose[s]);
    orb_free(ctx, one->own[s]);
  }
}

/* A trial of its own, which lies where `one` lies. */
static orb_status copy_trial(orb_context *ctx, const orb_trials *t, const orb_trial *one, orb_trial *out) {
  *out = (orb_trial){.cost = INFINITY, .rough = INFINITY};
  for (int s = 0; s < 2; s++) {
    const size_t n = (size_t)t->copy[s].mesh.vertex_count;
    ORB_TRY(orb_trial_pose_create(ctx, &t->copy[s].mesh, &out->pose[s]));
    memcpy(out->pose[s].position, one->pose[s].position, 3 * n * sizeof(double));
    out->own[s] = ORB_NEW(ctx, int32_t, n);
    if (!out->own[s]) {
      return ORB_E_NO_MEMORY;
    }
  }
  out->map[0] = (orb_rough_map){out->own[0], out->own[1]};
  out->map[1] = (orb_rough_map){out->own[1], out->own[0]};
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
  ORB_TRY(orb_trial_register(ctx, t, one, 0));
  ORB_TRY(orb_trial_register(ctx, t, one, 1));
  orb_trial_fill_cost(t, one, 1);
  one->rough = one->cost;
  orb_trial_fill_cost(t, one, 2);
  return ORB_OK;
}

/* The course goes on where an extension costs a little more, since the next one may cost less than all before. */
static orb_status run_chain(orb_context *ctx, void *arg, int32_t i) {
  const chains *all = arg;
  orb_trials *t = all->t;
  orb_trial *best = &t->trial[all->trial[i]], next = {0}, last = {0};
  orb_agreed agreed = {0};
  orb_status status;
  int extended = 1;
  ORB_GO(status, orb_agreed_create(ctx, &t->copy[0].mesh, &t->copy[1].mesh, &agreed), end);
  ORB_GO(status, copy_trial(ctx, t, best, &next), end);
  for (int round = 0; round < ORB_FIND_EXTENSIONS; round++) {
    ORB_GO(status, extend(ctx, t, &agreed, &next, round == 0 ? ORB_FIND_AGREED_INNER : 1, &extended), end);
    if (!extended) {
      break;
    }
    const double cost = next.cost;
    if (next.cost < best->cost) {
      ORB_GO(status, copy_trial(ctx, t, &next, &last), end);
      free_trial(ctx, best);
      *best = next;
      next = last;
      last = (orb_trial){0};
    }
    if (cost > all->most) {
      break;
    }
  }
end:
  free_trial(ctx, &next);
  free_trial(ctx, &last);
  orb_agreed_free(ctx, &agreed);
  return status;
}

/* Lists the trials of least cost. */
static void list_best(chains *all) {
  const orb_trials *t = all->t;
  for (int32_t i = 0; i < t->count; i++) {
    int32_t k = all->count < ORB_FIND_EXTENDED ? all->count : ORB_FIND_EXTENDED - 1;
    if (!(t->trial[i].cost < (all->count < ORB_FIND_EXTENDED ? INFINITY : t->trial[all->trial[k]].cost))) {
      continue;
    }
    for (; k > 0 && t->trial[i].cost < t->trial[all->trial[k - 1]].cost; k--) {
      all->trial[k] = all->trial[k - 1];
    }
    all->trial[k] = i;
    all->count += all->count < ORB_FIND_EXTENDED;
  }
}

orb_status orb_trials_extend(orb_trials *t) {
  const orb_trial *best = &t->trial[orb_trials_best(t)];
  chains all = {.t = t};
  if (!((best->bend[0] + best->bend[1]) / 2 > ORB_FIND_EXTENDS)) {
    return ORB_OK;
  }
  all.most = ORB_FIND_EXTENDS_BEHIND * best->cost;
  list_best(&all);
  return orb_tasks_run(t->ctx, all.count, run_chain, &all);
}
