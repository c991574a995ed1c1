/* Sweeps of one level, with flips and without, what pulls its vertices, and copies to go back to. */
#include <math.h>
#include <string.h>

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
    l->pull[v] = (!drawn || drawn[m]) && c->doubted[m] < ORB_MAP_FOLDED ? strength * l->area[v] : 0;
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
