/* Rounds of sweeps on one level: with and without flips, drawn to targets, and back to none. */
#include <math.h>
#include <string.h>

#include "align/map/engine/rounds.h"
#include "align/map/engine/step.h"
#include "align/map/engine/untangle.h"
#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

enum { SOFT_SWEEPS = 20, DRAW_ROUNDS = 5, DRAW_SWEEPS = 40, CLEARINGS = 8 };
static const double EPSILON = 0.1;
static const double FIRST_BARRIER = 1e-4;
static const double STILL = 1e-3; /* of a mean edge: less does not count as moving */
static const double OVER = 1.5;   /* over-relaxation, where no flips are allowed */
static const double GROWING = 1.05;
static const double DRAW = 20, DRAW_FALL = 0.8;

orb_map_rules orb_map_soft(double barrier) {
  return (orb_map_rules){.soft = 1, .barrier = barrier, .epsilon = EPSILON, .omega = 1};
}

orb_map_rules orb_map_hard(void) {
  return (orb_map_rules){.soft = 0, .barrier = 1, .epsilon = EPSILON, .omega = OVER};
}

/* All vertices take part in the first one. */
orb_status orb_map_sweeps(orb_map_run *c, orb_map_level *l, orb_map_rules rules, int count) {
  double moved;
  int32_t stepped = l->count;
  rules.still = STILL * sqrt(4 * M_PI / l->triangle_count);
  for (int32_t v = 0; v < l->count; v++) {
    l->moved[v] = INFINITY;
  }
  orb_status status = ORB_OK;
  orb_map_packed_enter(&c->packed, l);
  for (int i = 0; i < count && stepped > l->count / 500 && status == ORB_OK; i++) {
    status = orb_map_level_sweep(c->ctx, l, &c->packed.b, &rules, &moved, &stepped);
    c->work -= stepped;
  }
  orb_map_packed_leave(&c->packed, l);
  return status;
}

void orb_map_set_pull(const orb_map_run *c, orb_map_level *l, const int32_t *to_mesh, double strength) {
  for (int32_t v = 0; v < l->count; v++) {
    l->pull[v] = strength * l->area[v];
    if (strength > 0) {
      memcpy(l->goal + 3 * (size_t)v, c->goal + 3 * (size_t)to_mesh[l->vertex[v]], sizeof(double[3]));
    }
  }
}

orb_status orb_map_clear_flips(orb_map_run *c, orb_map_level *l, int rounds, int32_t *flips) {
  orb_map_rules rules = orb_map_soft(FIRST_BARRIER);
  double *copy = ORB_NEW(c->ctx, double, 3 * (size_t)l->count);
  orb_status status = copy ? ORB_OK : ORB_E_NO_MEMORY;
  int32_t at_first = *flips = orb_map_level_flips(l);
  for (int round = 0; round < rounds && *flips && c->work > 0 && status == ORB_OK; round++) {
    ORB_GO(status, orb_map_sweeps(c, l, rules, SOFT_SWEEPS), done);
    rules.barrier *= 3;
    *flips = orb_map_level_flips(l);
    at_first = round == 0 ? *flips : at_first;
    if (round > 1 && *flips > GROWING * at_first) {
      break; /* the stronger the barrier the more flips: large parts are folded */
    }
    if (*flips) {
      memcpy(copy, l->x, 3 * (size_t)l->count * sizeof *copy);
      ORB_GO(status, orb_map_level_untangle(c->ctx, l, flips, &c->work), done);
      if (*flips) {
        memcpy(l->x, copy, 3 * (size_t)l->count * sizeof *copy);
      } else {
        ORB_GO(status, orb_map_level_locate_all(c->ctx, l, &c->b, 0), done);
      }
    }
  }
done:
  orb_free(c->ctx, copy);
  return status;
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

void orb_map_copy_free(orb_map_run *c, orb_map_copy *s) {
  orb_free(c->ctx, s->place);
  orb_free(c->ctx, s->y);
  memset(s, 0, sizeof *s);
}

/* The energy with that of the pull, as the sweeps lower it. */
static double pulled_energy(const orb_map_level *l) {
  double pull = 0, area = 0;
  for (int32_t v = 0; v < l->count; v++) {
    pull += l->pull[v] > 0 ? l->pull[v] * orb_distance2(l->y + 3 * (size_t)v, l->goal + 3 * (size_t)v) : 0;
    area += l->area[v];
  }
  return orb_map_level_energy(l) + (area > 0 ? pull / (4 * area) : 0);
}

orb_status orb_map_loosen(orb_map_run *c, orb_map_level *l, int soft_sweeps, int hard_sweeps) {
  orb_map_copy before = {0};
  double energy = pulled_energy(l);
  int32_t flips;
  orb_status status = ORB_OK;
  if (c->work <= 0) {
    return status; /* flips that come could not be cleared */
  }
  ORB_GO(status, orb_map_copy_take(c, l, &before), done);
  ORB_GO(status, orb_map_sweeps(c, l, orb_map_soft(1), soft_sweeps), done);
  ORB_GO(status, orb_map_clear_flips(c, l, 3, &flips), done);
  if (!flips) {
    ORB_GO(status, orb_map_sweeps(c, l, orb_map_hard(), hard_sweeps), done);
  }
  int worse = flips || orb_map_level_flips(l) || pulled_energy(l) >= energy;
  if (worse) {
    orb_map_copy_restore(&before, l);
  }
done:
  orb_map_copy_free(c, &before);
  return status;
}

/* A round lets flips come while the pull is on, drives them out and settles. A round that cannot be untangled is taken
 * back and ends it. */
orb_status orb_map_draw(orb_map_run *c, orb_map_level *l, const int32_t *to_mesh) {
  double pull = DRAW;
  orb_status status = ORB_OK;
  for (int round = 0; round < DRAW_ROUNDS && status == ORB_OK && c->work > 0; round++, pull *= DRAW_FALL) {
    orb_map_copy before = {0};
    int32_t flips;
    orb_map_set_pull(c, l, to_mesh, pull);
    ORB_GO(status, orb_map_copy_take(c, l, &before), next);
    ORB_GO(status, orb_map_sweeps(c, l, orb_map_soft(FIRST_BARRIER), DRAW_SWEEPS), next);
    ORB_GO(status, orb_map_clear_flips(c, l, CLEARINGS, &flips), next);
    if (flips) {
      orb_map_copy_restore(&before, l);
      round = DRAW_ROUNDS;
    }
    ORB_GO(status, orb_map_sweeps(c, l, orb_map_hard(), DRAW_SWEEPS), next);
  next:
    orb_map_copy_free(c, &before);
  }
  return status;
}
