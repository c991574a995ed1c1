/* Rounds of sweeps on one level: with flips and without, loosening, and drawing to spatial targets. */
#include <math.h>
#include <string.h>

#include "align/map/engine/clear.h"
#include "align/map/engine/rounds.h"
#include "align/map/engine/sweep.h"
#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

orb_map_rules orb_map_soft(const orb_map_params *params, double barrier) {
  return (orb_map_rules){.soft = 1, .barrier = barrier, .epsilon = params->star.epsilon, .omega = 1};
}

orb_map_rules orb_map_hard(const orb_map_params *params) {
  return (orb_map_rules){.soft = 0, .barrier = 1, .epsilon = params->star.epsilon, .omega = params->sweep.over};
}

/* In the first sweep no vertex waits. */
orb_status orb_map_sweeps(orb_map_run *c, orb_map_level *l, orb_map_rules rules, int count) {
  rules.still = c->params.sweep.still * sqrt(4 * M_PI / l->triangle_count);
  for (int32_t v = 0; v < l->count; v++) {
    l->moved[v] = INFINITY;
  }
  orb_map_packed_enter(&c->packed, l);
  orb_status status =
      orb_map_level_sweeps(c->ctx, l, &c->packed, &rules, count, l->count / c->params.sweep.still_share, &c->work);
  orb_map_packed_leave(&c->packed, l);
  return status;
}

/* Springs of soft landmarks draw to the landmark's place on the fixed shape. */
static void set_springs(const orb_map_run *c, orb_map_level *l, const int32_t *to_mesh) {
  double area = 0;
  for (int32_t v = 0; v < l->count; v++) {
    area += l->area[v];
  }
  for (int32_t v = 0; v < l->count; v++) {
    for (int32_t i = 0; i < c->springs.count; i++) {
      if (c->springs.moving[i] == to_mesh[l->vertex[v]]) {
        l->pull[v] = 4 * area * c->springs.weight[i]; /* pulled_energy() divides by that */
        memcpy(l->target + 3 * (size_t)v, c->b.x + 3 * (size_t)c->springs.fixed[i], sizeof(double[3]));
      }
    }
  }
}

void orb_map_set_pull(const orb_map_run *c, orb_map_level *l, const int32_t *to_mesh, double strength) {
  orb_map_pull_drawn(c, l, to_mesh, strength, NULL);
}

void orb_map_pull_drawn(const orb_map_run *c, orb_map_level *l, const int32_t *to_mesh, double strength,
                        const unsigned char *drawn) {
  for (int32_t v = 0; v < l->count; v++) {
    const int32_t m = to_mesh[l->vertex[v]];
    l->pull[v] = (!drawn || drawn[m]) && c->doubted[m] != ORB_MAP_FOLDED ? strength * l->area[v] : 0;
    if (strength > 0) {
      memcpy(l->target + 3 * (size_t)v, c->target + 3 * (size_t)m, sizeof(double[3]));
    }
  }
  if (c->springs.count > 0) {
    set_springs(c, l, to_mesh);
  }
}

orb_status orb_map_copy_take(orb_map_run *c, const orb_map_level *l, orb_map_copy *s) {
  s->place = ORB_NEW(c->ctx, orb_place, l->count);
  s->y = ORB_NEW(c->ctx, double, 9 * (size_t)l->count);
  if (!s->place || !s->y) {
    return ORB_E_NO_MEMORY;
  }
  memcpy(s->place, l->place, (size_t)l->count * sizeof *s->place);
  memcpy(s->y, l->y, 9 * (size_t)l->count * sizeof *s->y);
  return ORB_OK;
}

void orb_map_copy_restore(const orb_map_copy *s, orb_map_level *l) {
  memcpy(l->place, s->place, (size_t)l->count * sizeof *s->place);
  memcpy(l->y, s->y, 9 * (size_t)l->count * sizeof *s->y);
}

void orb_map_copy_restore_vertex(const orb_map_copy *s, orb_map_level *l, int32_t v) {
  const size_t n = 3 * (size_t)l->count, at = 3 * (size_t)v;
  l->place[v] = s->place[v];
  for (size_t block = 0; block < 3; block++) { /* y, n and x */
    memcpy(l->y + block * n + at, s->y + block * n + at, sizeof(double[3]));
  }
}

void orb_map_copy_free(orb_map_run *c, orb_map_copy *s) {
  orb_free(c->ctx, s->place);
  orb_free(c->ctx, s->y);
  memset(s, 0, sizeof *s);
}

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
  ORB_GO(status, orb_map_clear_flips(c, l, c->params.clear.first_barrier, c->params.clear.loosen_rounds, &flips), done);
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
  ORB_GO(status, orb_map_clear_flips(c, l, params->clear.first_barrier, params->draw.clearings, &flips), done);
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
