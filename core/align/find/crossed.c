#include "align/find/crossed.h"

#include <math.h>

#include "base/check.h"
#include "base/context.h"
#include "base/tasks.h"
#include "numeric/vec3.h"

/* For each vertex of the other copy, the vertex of copy s that pose s takes nearest to it. */
static void fill_inverse(const orb_trials *t, const orb_trial *one, int s, int32_t *out) {
  const orb_mesh *mesh = &t->copy[s].mesh, *other = &t->copy[1 - s].mesh;
  for (int32_t u = 0; u < other->vertex_count; u++) {
    double least = INFINITY;
    out[u] = 0;
    for (int32_t v = 0; v < mesh->vertex_count; v++) {
      const double d = orb_distance2(one->pose[s].position + 3 * (size_t)v, other->positions + 3 * (size_t)u);
      out[u] = d < least ? v : out[u];
      least = d < least ? d : least;
    }
  }
}

/* Trials that are crossed side by side. */
typedef struct crossing {
  orb_trials *t;
  double most; /* cost of one that is crossed */
} crossing;

static orb_status cross(orb_context *ctx, void *arg, int32_t i) {
  const crossing *all = arg;
  const orb_trials *t = all->t;
  orb_trial *one = &all->t->trial[i], crossed = {0};
  orb_status status;
  if (!(one->cost < INFINITY) || one->cost > all->most) {
    return ORB_OK; /* it was dropped, or is far behind */
  }
  ORB_GO(status, orb_context_check(ctx), end);
  ORB_GO(status, orb_trial_create(ctx, t, &crossed), end);
  for (int s = 0; s < 2; s++) {
    fill_inverse(t, one, 1 - s, crossed.own[s]);
    orb_trial_images(t, one, 1 - s, crossed.own[1 - s]);
    ORB_GO(status, orb_trial_register(ctx, t, &crossed, s), end);
  }
  for (int s = 0; s < 2; s++) {
    if (crossed.bend[s] < one->bend[s] && orb_trial_keeps_hint(t, &crossed, s)) {
      const orb_elastic_pose before = one->pose[s];
      one->pose[s] = crossed.pose[s];
      crossed.pose[s] = before;
      one->bend[s] = crossed.bend[s];
      one->resized[s] = crossed.resized[s];
      one->scattered[s] = crossed.scattered[s];
    }
  }
  orb_trial_fill_cost(t, one, 2);
end:
  orb_trial_free(ctx, &crossed);
  return status;
}

orb_status orb_trials_cross(orb_trials *t) {
  crossing all = {t, ORB_FIND_CROSSED_BEHIND * t->trial[orb_trials_best(t)].cost};
  return orb_trials_bend_much(t) ? orb_tasks_run(t->ctx, t->count, cross, &all) : ORB_OK;
}
