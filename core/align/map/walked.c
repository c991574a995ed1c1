#include "align/map/walked.h"

#include <math.h>
#include <string.h>

#include "align/map/engine/rounds.h"
#include "align/map/engine/run.h"
#include "align/map/levels.h"
#include "align/map/starts/landmark_walk.h"
#include "base/check.h"
#include "base/memory.h"

/* A map on a level of the moving shape. */
typedef struct trial {
  orb_refiner *refiner;
  orb_map_level level;
} trial;

/* The level on which the walk ended, at the points that it ended at. */
static orb_status begin(orb_map_run *c, orb_walk_level *walked, trial *t) {
  orb_map_levels_adopt(c, &walked->hierarchy);
  ORB_TRY(orb_map_levels_begin(c, &t->refiner));
  return orb_map_level_place(c, t->refiner, ORB_MAP_GIVEN, walked->live, &t->level);
}

/* Optimises the levels up to the coarse one. *energy: there; INFINITY where the first level's is hopeless. */
static orb_status optimise(orb_map_run *c, trial *t, double *energy) {
  const orb_map_params *p = &c->params;
  const int32_t n = c->vertex_count;
  int32_t size = p->walked.size < n ? p->walked.size : n;
  unsigned char *known = ORB_NEW(c->ctx, unsigned char, n);
  orb_status status = known ? ORB_OK : ORB_E_NO_MEMORY;
  for (int first = 1; status == ORB_OK; first = 0) {
    int last = t->refiner->live >= size;
    ORB_GO(status, orb_map_sweeps(c, &t->level, orb_map_hard(p), last ? p->walked.last_sweeps : p->walked.sweeps),
           done);
    if (first || last) {
      ORB_GO(status, orb_map_loosen(c, &t->level, p->walked.loosen, p->walked.loosen), done);
    }
    orb_map_level_store(c, &t->level, t->refiner);
    *energy = orb_map_level_energy(&t->level);
    if (last || *energy > p->walked.hopeless) {
      break;
    }
    ORB_GO(status, orb_map_level_next(c, t->refiner, &t->level, known, 0), done);
  }
done:
  orb_free(c->ctx, known);
  return status;
}

/* Refines to all vertices; the result becomes the best map if it is good. */
static orb_status refine(orb_map_run *c, trial *t, int *good) {
  int failed = 0;
  ORB_TRY(orb_map_levels_refine(c, t->refiner, &t->level, 0, 0, &failed));
  double energy = orb_map_level_energy(&t->level);
  *good = !failed && energy <= c->params.energy.good;
  if (*good) {
    c->best_energy = energy;
    orb_refiner_points(t->refiner, c->best);
  }
  return ORB_OK;
}

orb_status orb_map_try_walked(orb_map_run *c, int *good) {
  orb_walk_level walked = {0};
  trial t = {0};
  double *fixed = NULL, energy = INFINITY;
  int stuck;
  orb_status status;
  *good = 0;
  ORB_GO(status, orb_map_walk_level(c, &walked, &fixed, &stuck), done);
  if (stuck) {
    goto done;
  }
  memcpy(c->start, walked.points, 3 * (size_t)c->vertex_count * sizeof *c->start);
  ORB_GO(status, orb_map_take_sphere(c, &fixed), done);
  ORB_GO(status, begin(c, &walked, &t), done);
  if (orb_map_level_flips(&t.level) == 0) {
    ORB_GO(status, optimise(c, &t, &energy), done);
  }
  if (energy <= c->params.energy.good) {
    ORB_GO(status, refine(c, &t, good), done);
  }
  if (!*good) {
    memcpy(c->start, c->moving->points, 3 * (size_t)c->vertex_count * sizeof *c->start);
    status = orb_map_take_best(c);
  }
done:
  orb_map_level_free(c->ctx, &t.level);
  orb_refiner_destroy(c->ctx, t.refiner);
  orb_walk_level_free(c->ctx, &walked);
  orb_free(c->ctx, fixed);
  return status;
}
