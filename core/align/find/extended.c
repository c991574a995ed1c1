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

/* Copies the positions of a trial. `out` has its own maps, still to be filled, and no cost. */
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

/* Extends one trial again and again. An extension may cost a little more than the one before, since the next one may
 * cost less than both. */
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

static int is_listed(const chains *all, int32_t i) {
  int listed = 0;
  for (int32_t k = 0; k < all->count; k++) {
    listed |= all->trial[k] == i;
  }
  return listed;
}

/* Lists the trials of least cost, the best first. */
static void list_best(chains *all) {
  const orb_trial *trial = all->t->trial;
  for (int32_t next = 0; next >= 0 && all->count < ORB_FIND_EXTENDED;) {
    next = -1;
    for (int32_t i = 0; i < all->t->count; i++) {
      if (!is_listed(all, i) && trial[i].cost < (next < 0 ? INFINITY : trial[next].cost)) {
        next = i;
      }
    }
    if (next >= 0) {
      all->trial[all->count++] = next;
    }
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
