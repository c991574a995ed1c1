#include "align/map/walked.h"

#include <math.h>
#include <string.h>

#include "align/map/engine/loosen.h"
#include "align/map/engine/rounds.h"
#include "align/map/starts/landmark_walk.h"
#include "base/check.h"
#include "base/memory.h"

/* Frees vertices that the barriers have locked, until that no longer helps. */
static orb_status loosen(orb_map_run *c, orb_map_level *l, int most) {
  const orb_map_params *p = &c->params;
  for (int i = 0, idle = 0; i < most && idle < 2; i++) {
    double before = orb_map_level_energy(l);
    ORB_TRY(orb_map_loosen(c, l, p->walked.barriers[idle], p->walked.loosen, p->walked.loosen));
    idle = orb_map_level_energy(l) < (1 - p->walked.gain) * before ? 0 : idle + 1;
  }
  return ORB_OK;
}

/* Optimises the levels up to the coarse one. With guides, the spatial targets hold the map. Without, the coarse one is
 * loosened, and the energy becomes INFINITY where limbs are twisted. */
static orb_status optimise(orb_map_run *c, int32_t guides, orb_map_walked *w) {
  const orb_map_params *p = &c->params;
  const int32_t n = c->vertex_count;
  int32_t size = p->walked.size < n ? p->walked.size : n;
  unsigned char *known = ORB_NEW(c->ctx, unsigned char, n);
  orb_status status = known ? ORB_OK : ORB_E_NO_MEMORY;
  for (int first = 1, last = 0; !last && status == ORB_OK; first = 0) {
    last = w->refiner->live >= size;
    orb_map_set_pull(c, &w->level, c->hierarchy->surface.to_mesh, w->hold);
    ORB_GO(status, orb_map_sweeps(c, &w->level, orb_map_hard(p), last ? p->walked.last_sweeps : p->walked.sweeps),
           done);
    w->energy = orb_map_level_energy(&w->level);
    if (guides == 0 && w->energy > p->walked.hopeless) {
      w->energy = INFINITY;
      break;
    }
    if (last ? guides == 0 : first) {
      ORB_GO(status, loosen(c, &w->level, last ? p->walked.loosen_most : 1), done);
    }
    orb_map_level_store(c, &w->level, w->refiner);
    w->energy = orb_map_level_energy(&w->level);
    if (!last) {
      int has_room;
      ORB_GO(status, orb_map_level_next(c, w->refiner, &w->level, known, 0, &has_room), done);
      if (!has_room) {
        w->energy = INFINITY;
        break;
      }
    } else if (guides == 0 && w->energy > p->walked.twisted) {
      w->energy = INFINITY;
    }
  }
done:
  orb_free(c->ctx, known);
  return status;
}

/* Gives this map's sphere and hierarchy to the run. */
static orb_status enter(orb_map_run *c, orb_map_walked *w) {
  double *fixed = ORB_NEW(c->ctx, double, 3 * (size_t)c->fixed->mesh.vertex_count);
  if (!fixed) {
    return ORB_E_NO_MEMORY;
  }
  memcpy(fixed, w->fixed, 3 * (size_t)c->fixed->mesh.vertex_count * sizeof *fixed);
  orb_status status = orb_map_take_sphere(c, &fixed);
  orb_free(c->ctx, fixed); /* NULL once it is taken */
  orb_map_levels_adopt(c, &w->hierarchy);
  return status;
}

/* Takes them back from the run. */
static orb_status leave(orb_map_run *c, orb_map_walked *w) {
  w->hierarchy = c->hierarchy;
  c->hierarchy = NULL;
  return orb_map_take_best(c);
}

orb_status orb_map_walked_create(orb_map_run *c, int32_t guides, orb_map_walked *w) {
  orb_walk_level level = {0};
  int stuck;
  orb_status status;
  *w = (orb_map_walked){.energy = INFINITY, .hold = guides != 0 ? c->params.walked.hold : 0};
  ORB_GO(status, orb_map_walk_level(c, guides, &level, &w->fixed, &stuck), done);
  if (stuck) {
    goto done;
  }
  memcpy(c->start, level.points, 3 * (size_t)c->vertex_count * sizeof *c->start);
  w->hierarchy = level.hierarchy;
  level.hierarchy = NULL;
  ORB_GO(status, enter(c, w), done);
  ORB_GO(status, orb_map_levels_begin(c, &w->refiner), done);
  ORB_GO(status, orb_map_level_place(c, w->refiner, ORB_MAP_GIVEN, level.live, &w->level), done);
  if (orb_map_level_flips(&w->level) == 0) {
    ORB_GO(status, optimise(c, guides, w), done);
  }
  memcpy(c->start, c->moving->points, 3 * (size_t)c->vertex_count * sizeof *c->start);
  status = leave(c, w);
done:
  orb_walk_level_free(c->ctx, &level);
  return status;
}

/* Loosens the coarse level. */
static orb_status loosen_coarse(orb_map_run *c, orb_map_walked *w) {
  ORB_TRY(enter(c, w));
  ORB_TRY(loosen(c, &w->level, c->params.walked.loosen_most));
  orb_map_level_store(c, &w->level, w->refiner);
  w->energy = orb_map_level_energy(&w->level);
  return leave(c, w);
}

/* Loosening hardly changes which walk is the best one, so only that is loosened, unless it is lost. */
orb_status orb_map_walked_improve(orb_map_run *c, orb_map_walked *best) {
  const orb_map_params *p = &c->params;
  const double given = best->energy;
  const int most = c->beat.energy > 0 ? p->walked.beat_most : ORB_MAP_GUIDED;
  int agree = 0;
  for (int i = 0; i < most + ORB_MAP_GUIDED_FEW && best->energy > p->walked.enough && !agree; i++) {
    orb_map_walked w;
    if (i >= most && best->energy < INFINITY) {
      break;
    }
    orb_map_allow(c, p->walked.work);
    orb_status status = orb_map_walked_create(c, i < most ? p->walked.guides[i] : p->walked.few[i - most], &w);
    agree = w.energy < INFINITY && fabs(w.energy - best->energy) <= p->walked.agree * (w.energy - 1);
    if (status == ORB_OK && w.energy < best->energy) {
      orb_map_walked worse = *best;
      *best = w;
      w = worse;
    }
    orb_map_walked_free(c, &w);
    ORB_TRY(status);
  }
  orb_map_allow(c, p->walked.work);
  return best->energy < given && best->energy <= p->walked.lost ? loosen_coarse(c, best) : ORB_OK;
}

orb_status orb_map_walked_refine(orb_map_run *c, orb_map_walked *w) {
  int failed = 0;
  ORB_TRY(enter(c, w));
  ORB_TRY(orb_map_levels_refine(c, w->refiner, &w->level, 0, w->hold, 0, &failed));
  w->energy = failed ? INFINITY : orb_map_level_energy(&w->level);
  if (!failed) {
    c->best_energy = w->energy;
    orb_refiner_points(w->refiner, c->best);
  }
  return leave(c, w);
}

void orb_map_walked_free(orb_map_run *c, orb_map_walked *w) {
  orb_map_level_free(c->ctx, &w->level);
  orb_refiner_destroy(c->ctx, w->refiner);
  orb_hierarchy_destroy(c->ctx, w->hierarchy);
  orb_free(c->ctx, w->fixed);
  memset(w, 0, sizeof *w);
}
