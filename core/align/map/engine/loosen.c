/* Rounds of sweeps with flips allowed, after which these are cleared: loosening, and drawing to spatial targets. */
#include "align/map/engine/loosen.h"

#include "align/map/engine/clear.h"
#include "align/map/engine/rounds.h"
#include "base/check.h"
#include "numeric/vec3.h"

/* The energy with that of the pull: what the sweeps lower. */
static double pulled_energy(const orb_map_level *l) {
  double pull = 0, area = 0;
  for (int32_t v = 0; v < l->count; v++) {
    pull += l->pull[v] > 0 ? l->pull[v] * orb_distance2(l->y + 3 * (size_t)v, l->target + 3 * (size_t)v) : 0;
    area += l->area[v];
  }
  return orb_map_level_energy(l) + (area > 0 ? pull / (4 * area) : 0);
}

orb_status orb_map_loosen(orb_map_run *c, orb_map_level *l, double barrier, int soft_sweeps, int hard_sweeps) {
  orb_map_copy before = {0};
  double energy = pulled_energy(l);
  int32_t flips;
  orb_status status = ORB_OK;
  if (c->work <= 0) {
    return status; /* no work is left to clear the flips that it would make */
  }
  ORB_GO(status, orb_map_copy_take(c, l, &before), done);
  ORB_GO(status, orb_map_sweeps(c, l, orb_map_soft(&c->params, barrier), soft_sweeps), done);
  ORB_GO(status, orb_map_clear_flips(c, l, c->params.clear.first_barrier, c->params.clear.loosen_rounds, 0, &flips),
         done);
  if (!flips) {
    ORB_GO(status, orb_map_sweeps(c, l, orb_map_hard(&c->params), hard_sweeps), done);
  }
  int worse = flips || orb_map_level_flips(l) || pulled_energy(l) >= energy;
  if (worse) {
    orb_map_copy_restore(&before, l);
  }
done:
  orb_map_copy_free(c, &before);
  return status;
}

/* One round: sweeps with flips allowed while the pull is on, clears the flips, and sweeps without flips. *held 0: the
 * flips cannot be cleared, and the level is as it was except for the last sweeps. */
static orb_status draw_round(orb_map_run *c, orb_map_level *l, int *held) {
  const orb_map_params *params = &c->params;
  orb_map_copy before = {0};
  int32_t flips;
  orb_status status;
  ORB_GO(status, orb_map_copy_take(c, l, &before), done);
  ORB_GO(status, orb_map_sweeps(c, l, orb_map_soft(params, params->clear.first_barrier), params->draw.sweeps), done);
  ORB_GO(status, orb_map_clear_flips(c, l, params->clear.first_barrier, params->draw.clearings, 0, &flips), done);
  *held = flips == 0;
  if (flips) {
    orb_map_copy_restore(&before, l);
  }
  status = orb_map_sweeps(c, l, orb_map_hard(params), params->draw.sweeps);
done:
  orb_map_copy_free(c, &before);
  return status;
}

/* A round that does not lower the energy is the last, since the pull of the next one is weaker; the map of least energy
 * stays. */
orb_status orb_map_draw(orb_map_run *c, orb_map_level *l, const int32_t *to_mesh) {
  const orb_map_params *params = &c->params;
  orb_map_copy best = {0};
  double pull = params->draw.pull, least = orb_map_level_energy(l);
  orb_status status;
  int held = 1;
  ORB_GO(status, orb_map_copy_take(c, l, &best), done);
  for (int round = 0; round < params->draw.rounds && held && c->work > 0; round++, pull *= params->draw.fall) {
    orb_map_set_pull(c, l, to_mesh, pull);
    ORB_GO(status, draw_round(c, l, &held), done);
    double energy = orb_map_level_energy(l);
    held = held && energy < least;
    if (energy < least) {
      least = energy;
      orb_map_copy_free(c, &best);
      ORB_GO(status, orb_map_copy_take(c, l, &best), done);
    }
  }
  if (orb_map_level_energy(l) > least) {
    orb_map_copy_restore(&best, l);
  }
done:
  orb_map_copy_free(c, &best);
  return status;
}
