#include "align/map/space/drawn.h"

#include <string.h>

#include "align/map/engine/loosen.h"
#include "align/map/engine/rounds.h"
#include "base/check.h"
#include "numeric/vec3.h"

/* The share of the drawn vertices that are far from their targets. */
static double share_left(const orb_map_run *c, const orb_map_level *l, const int32_t *to_mesh,
                         const unsigned char *drawn) {
  const double far = c->params.slide.far;
  int32_t left = 0, all = 0;
  for (int32_t v = 0; v < l->count; v++) {
    const int32_t m = to_mesh[l->vertex[v]];
    if (!drawn || drawn[m]) {
      left += orb_distance2(l->y + 3 * (size_t)v, c->target + 3 * (size_t)m) > far * far;
      all++;
    }
  }
  return all > 0 ? (double)left / all : 0;
}

static orb_status draw_once(orb_map_run *c, orb_map_level *l, const int32_t *to_mesh, const unsigned char *drawn,
                            double pull) {
  const orb_map_params *p = &c->params;
  orb_map_allow(c, p->targets.work);
  orb_map_pull_drawn(c, l, to_mesh, pull, drawn);
  ORB_TRY(orb_map_sweeps(c, l, orb_map_hard(p), p->slide.sweeps));
  return orb_map_loosen(c, l, p->clear.first_barrier, p->slide.loosen, p->slide.sweeps);
}

/* A limb that has to go far is still on its way after a round. */
orb_status orb_map_draw_whole(orb_map_run *c, orb_map_level *l, const int32_t *to_mesh, const unsigned char *drawn,
                              double pull) {
  double before, left = 1;
  do {
    before = left;
    ORB_TRY(draw_once(c, l, to_mesh, drawn, pull));
    left = share_left(c, l, to_mesh, drawn);
  } while (left > c->params.slide.left && left < c->params.slide.arrived * before);
  return ORB_OK;
}

int orb_map_take_drawn(orb_map_run *c, const orb_map_level *l, const int32_t *to_mesh, double most) {
  const double energy = orb_map_level_energy(l);
  if (!(energy < most) || orb_map_level_flips(l) || orb_map_level_degree(l) != 1) {
    return 0;
  }
  for (int32_t v = 0; v < l->count; v++) {
    memcpy(c->best + 3 * (size_t)to_mesh[l->vertex[v]], l->x + 3 * (size_t)v, sizeof(double[3]));
  }
  c->best_energy = energy;
  return 1;
}
