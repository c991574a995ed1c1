/* Untangling clears most flips, and hardly crumples. What it leaves is unfolded. How much that crumples is close to
 * chance: the least flips may leave a map of 1.5 or of 5 times the energy. So it is tried in up to two ways a round,
 * and in further rounds as long as all ways crumple; the best one is taken. */
#include "align/map/engine/clear.h"

#include <math.h>
#include <string.h>

#include "align/map/engine/folds.h"
#include "align/map/engine/rounds.h"
#include "align/map/engine/unfold.h"
#include "align/map/engine/untangle.h"
#include "base/check.h"
#include "base/memory.h"
#include "base/tasks.h"

/* One way: where an unfolding starts, where it ends, and the flips that remain. */
typedef struct way {
  double *from, *to;
  int32_t flips;
} way;

enum { UNTANGLED, RESTORED, WAYS };

typedef struct clearing {
  orb_map_run *c;
  orb_map_level *l;
  size_t size;       /* of the points of all vertices, 3 each */
  double *before;    /* points before a round's untangling, */
  way ways[WAYS];    /* of a round, */
  double *best_from; /* before the best unfolding, */
  double *best_to;   /* and after it */
  double energy;     /* then; INFINITY: none has cleared all flips */
} clearing;

static orb_status clearing_create(clearing *w) {
  const size_t n = 3 * (size_t)w->l->count;
  w->size = n * sizeof *w->before;
  w->before = ORB_NEW(w->c->ctx, double, (3 + 2 * WAYS) * n);
  if (!w->before) {
    return ORB_E_NO_MEMORY;
  }
  w->best_from = w->before + n;
  w->best_to = w->best_from + n;
  for (int i = 0; i < WAYS; i++) {
    w->ways[i].from = w->best_to + (size_t)(2 * i + 1) * n;
    w->ways[i].to = w->ways[i].from + n;
  }
  return ORB_OK;
}

/* Unfolds a copy of the level, which shares all but its points. */
static orb_status unfold_one(orb_context *ctx, void *arg, int32_t i) {
  clearing *w = arg; /* of which each task writes its own way */
  way *one = &w->ways[i];
  orb_map_level level = *w->l;
  level.x = one->to;
  memcpy(one->to, one->from, w->size);
  return orb_map_level_unfold(ctx, &level, &one->flips);
}

/* Takes the level to the end of a way, and notes the way if it is the best one. Not if flips remain or the level then
 * covers the sphere another number of times. */
static orb_status judge(clearing *w, const way *one, int degree) {
  orb_map_level *l = w->l;
  memcpy(l->x, one->to, w->size);
  if (one->flips || (degree == 1 && orb_map_level_degree(l) != 1)) {
    return ORB_OK;
  }
  ORB_TRY(orb_map_level_locate_all(w->c->ctx, l, &w->c->b, 0));
  const double energy = orb_map_level_energy(l);
  if (energy < w->energy) {
    w->energy = energy;
    memcpy(w->best_from, one->from, w->size);
    memcpy(w->best_to, one->to, w->size);
  }
  return ORB_OK;
}

/* Unfolds a level that untangling has left with flips: from there, and from where folds are taken back, since
 * untangling makes some folds easier to unfold and only spreads others. *flips: those after folds are taken back. */
static orb_status unfold(clearing *w, int degree, int32_t *flips) {
  memcpy(w->ways[UNTANGLED].from, w->l->x, w->size);
  ORB_TRY(orb_map_level_restore_folds(w->c->ctx, w->l, w->before, flips));
  memcpy(w->ways[RESTORED].from, w->l->x, w->size);
  const int count = memcmp(w->ways[UNTANGLED].from, w->ways[RESTORED].from, w->size) == 0 ? 1 : WAYS;
  ORB_TRY(orb_tasks_run(w->c->ctx, count, unfold_one, w));
  for (int i = 0; i < count; i++) {
    ORB_TRY(judge(w, &w->ways[i], degree));
  }
  return ORB_OK;
}

/* Untangles the level, and unfolds what is left. *flips: those that untangling leaves; if there are any, the level is
 * as it was, and a way of unfolding may be noted. Either step may draw a triangle over half of the sphere: then no flip
 * remains, but the level covers the sphere twice. If it covered the sphere once before, that step does not count. */
static orb_status clear_once(clearing *w, int32_t *flips) {
  orb_map_run *c = w->c;
  orb_map_level *l = w->l;
  const orb_map_params *params = &c->params;
  const int32_t before = *flips, degree = orb_map_level_degree(l);
  int32_t restored = before;
  memcpy(w->before, l->x, w->size);
  ORB_TRY(orb_map_level_untangle(c->ctx, l, flips, &c->work));
  if (degree == 1 && orb_map_level_degree(l) != 1) {
    memcpy(l->x, w->before, w->size);
    *flips = before;
  }
  if (*flips == 0) {
    return orb_map_level_locate_all(c->ctx, l, &c->b, 0);
  }
  if (*flips > l->triangle_count / (c->given_target ? params->clear.hopeless : params->clear.unfold)) {
    memcpy(l->x, w->before, w->size);
    return ORB_OK;
  }
  ORB_TRY(unfold(w, degree, &restored));
  *flips = restored > 0 && restored < *flips ? restored : *flips;
  memcpy(l->x, w->before, w->size);
  return orb_map_level_locate_all(c->ctx, l, &c->b, 0);
}

/* Takes the best way. doubts: where it moves vertices, their targets are folded, so they no longer pull, which would
 * fold the map again or crumple it. */
static orb_status take_best(const clearing *w, int doubts) {
  orb_map_run *c = w->c;
  orb_map_level *l = w->l;
  memcpy(l->x, w->best_to, w->size);
  for (size_t v = 0; v < (size_t)l->count && doubts; v++) {
    if (memcmp(w->best_from + 3 * v, w->best_to + 3 * v, sizeof(double[3])) != 0) {
      c->doubted[l->to_mesh[l->vertex[v]]] = ORB_MAP_FOLDED;
    }
  }
  return orb_map_level_locate_all(c->ctx, l, &c->b, 0);
}

orb_status orb_map_clear_flips(orb_map_run *c, orb_map_level *l, double barrier, int rounds, int doubts,
                               int32_t *flips) {
  const orb_map_params *params = &c->params;
  orb_map_rules rules = orb_map_soft(params, barrier);
  clearing w = {.c = c, .l = l, .energy = INFINITY};
  orb_status status = clearing_create(&w);
  int32_t at_first = *flips = orb_map_level_flips(l);
  int most = rounds;
  double enough = 0;
  for (int round = 0; round < most && *flips && w.energy > enough && c->work > 0 && status == ORB_OK; round++) {
    ORB_GO(status, orb_map_sweeps(c, l, rules, params->clear.sweeps), done);
    rules.barrier *= params->clear.barrier_growth;
    *flips = orb_map_level_flips(l);
    at_first = round == 0 ? *flips : at_first;
    if (round > 1 && *flips > params->clear.flip_growth * at_first) {
      break; /* a stronger barrier makes more flips: large parts are folded */
    }
    enough = params->clear.crumples * orb_map_level_energy(l);
    if (*flips) {
      ORB_GO(status, clear_once(&w, flips), done);
      const int is_near = *flips <= params->untangle.few && !(w.energy < INFINITY);
      most = is_near ? 2 * rounds : rounds; /* too near to give up */
    }
  }
  if (*flips && w.energy < INFINITY) {
    *flips = 0;
    status = take_best(&w, doubts);
  }
done:
  orb_free(c->ctx, w.before);
  return status;
}
