#include "align/find/raised.h"

#include <math.h>

#include "base/check.h"
#include "base/context.h"
#include "base/tasks.h"
#include "elastic/carry.h"

/* Trials that are raised side by side. */
typedef struct raising {
  orb_trials *small;
  orb_trials *coarse;
  int32_t list[ORB_FIND_RAISED];
} raising;

/* Maps the vertices of coarse copy s to where the pose of the small one carries them. */
static orb_status map_vertices(orb_context *ctx, const raising *all, const orb_trial *from, int s, orb_trial *out) {
  const orb_mesh *mesh = &all->coarse->copy[s].mesh, *other = &all->coarse->copy[1 - s].mesh;
  ORB_TRY(orb_elastic_carry(ctx, &all->small->copy[s].mesh, &from->pose[s], mesh->positions, mesh->vertex_count,
                            &out->pose[s]));
  orb_survey_images(&all->coarse->survey[1 - s], other, out->pose[s].position, mesh->vertex_count, out->own[s]);
  return ORB_OK;
}

static orb_status raise_one(orb_context *ctx, void *arg, int32_t i) {
  const raising *all = arg;
  const orb_trial *from = &all->small->trial[all->list[i]];
  orb_trial *out = &all->coarse->trial[i];
  if (!(from->cost < INFINITY)) { /* it was dropped before its way back was registered */
    ORB_TRY(orb_trials_complete(ctx, all->small, all->list[i]));
  }
  ORB_TRY(orb_context_check(ctx));
  ORB_TRY(orb_trial_create(ctx, all->coarse, out));
  ORB_TRY(map_vertices(ctx, all, from, 0, out));
  ORB_TRY(map_vertices(ctx, all, from, 1, out));
  out->cost = out->rough = 0;
  return ORB_OK;
}

orb_status orb_trials_raise(orb_trials *small, orb_trials *coarse) {
  raising all = {.small = small, .coarse = coarse};
  const int32_t count = orb_trials_differing(small, ORB_FIND_RAISED_APART, ORB_FIND_RAISED, all.list);
  ORB_TRY(orb_trials_survey(coarse, 0));
  coarse->count = count; /* before they are made, so that orb_trials_close() frees them */
  return orb_tasks_run(coarse->ctx, count, raise_one, &all);
}
