#include "align/map/start.h"

#include <math.h>
#include <string.h>

#include "align/map/engine/clear.h"
#include "align/map/engine/loosen.h"
#include "align/map/engine/near.h"
#include "align/map/engine/rounds.h"
#include "align/map/levels.h"
#include "align/map/starts/place.h"
#include "base/check.h"

/* A second attempt at a start that was nearly cleared: from its places, against a barrier that begins harder. Which few
 * flips remain is close to chance, and a start that is nearly a map is worth more than all others. */
static orb_status clear_again(orb_map_run *c, orb_map_start start, orb_map_level *l, const int32_t *to_mesh,
                              int32_t *flips) {
  ORB_TRY(orb_map_place(c, l, to_mesh, start));
  orb_map_set_pull(c, l, to_mesh, 1);
  return orb_map_clear_flips(c, l, c->params.clear.first_barrier * c->params.clear.again, c->params.clear.rounds, 1,
                             flips);
}

/* Clears the flips of a start's first level. *flips: those left, which a finer level may clear. *given_up: the start is
 * dropped, which is not an error: another start, or the given alignment, remains. A start that covers the sphere twice
 * is dropped here, because sweeps without flips would keep it so. */
static orb_status clear_start(orb_map_run *c, const orb_refiner *r, orb_map_start start, orb_map_level *l,
                              int32_t *flips, int *given_up) {
  const int32_t *to_mesh = c->hierarchy->surface.to_mesh;
  const int32_t hopeless = l->triangle_count / c->hopeless_flips;
  const double before = orb_map_level_energy(l);
  *flips = orb_map_level_flips(l);
  if (*flips <= hopeless) {
    *given_up = before > c->hopeless;
    if (*given_up) {
      c->work -= c->params.work.given_up * (int64_t)c->vertex_count;
      return ORB_OK;
    }
    ORB_TRY(orb_map_clear_flips(c, l, c->params.clear.first_barrier, c->params.clear.rounds, 1, flips));
    if (*flips && start == ORB_MAP_SPATIAL && orb_map_is_near(l, *flips)) {
      ORB_TRY(clear_again(c, start, l, to_mesh, flips));
    }
  }
  int last = r->live == c->vertex_count || r->live > c->params.level.last;
  if (*flips && last && start == ORB_MAP_SPATIAL && c->pairs.count > 0 && orb_map_is_near(l, *flips)) {
    ORB_TRY(orb_map_keep_usable(c, l, to_mesh));
    ORB_TRY(orb_map_release(c, l, to_mesh, flips));
  }
  c->is_crumpled = !*flips && orb_map_level_energy(l) > c->crumpled * before;
  *given_up = *flips ? last || *flips > hopeless : c->is_crumpled || orb_map_level_degree(l) != 1;
  return ORB_OK;
}

/* What another start has unfolded says nothing of this one. */
static void trust_folds(orb_map_run *c) {
  for (int32_t v = 0; v < c->vertex_count; v++) {
    c->doubted[v] = c->doubted[v] == ORB_MAP_FOLDED ? ORB_MAP_TRUSTED : c->doubted[v];
  }
}

orb_status orb_map_run_start(orb_map_run *c, orb_map_start start) {
  orb_context *ctx = c->ctx;
  orb_refiner *r = NULL;
  orb_map_level level = {0};
  int32_t flips = 1, size = start == ORB_MAP_SPATIAL ? c->params.level.spatial : c->params.level.mapped;
  int given_up = 0, is_given = start == ORB_MAP_GIVEN;
  orb_map_finish finish = {.pull = is_given ? 0 : c->params.level.pull, .rough = is_given && c->params.work.rough};
  orb_status status;
  if (start == ORB_MAP_SPATIAL) {
    trust_folds(c);
  }
  ORB_GO(status, orb_map_levels_begin(c, &r), done);
  while (flips) {
    ORB_GO(status, orb_map_level_place(c, r, start, size, &level), done);
    ORB_GO(status, clear_start(c, r, start, &level, &flips, &given_up), done);
    if (given_up) {
      goto done;
    }
    if (flips) {
      memset(r->pinned, 0, (size_t)c->vertex_count);
    }
    size = r->live * 2;
  }
  if (start == ORB_MAP_DRAWN) {
    ORB_GO(status, orb_map_draw(c, &level, c->hierarchy->surface.to_mesh), done);
  }
  finish.irons = c->given_target != NULL; /* other starts compete with walks, which have no crumples */
  status = orb_map_levels_finish(c, r, &level, &finish);
done:
  orb_map_level_free(ctx, &level);
  orb_refiner_destroy(ctx, r);
  return status;
}

orb_status orb_map_start_flips(orb_map_run *c, int32_t *flips) {
  orb_refiner *r = NULL;
  orb_map_level level = {0};
  orb_status status;
  ORB_GO(status, orb_map_levels_begin(c, &r), done);
  ORB_GO(status, orb_map_level_place(c, r, ORB_MAP_SPATIAL, c->params.level.spatial, &level), done);
  *flips = orb_map_level_flips(&level);
done:
  orb_map_level_free(c->ctx, &level);
  orb_refiner_destroy(c->ctx, r);
  return status;
}

orb_status orb_map_run_passes(orb_map_run *c, int draws) {
  double last = c->best_energy < c->settled ? INFINITY : 0;
  while (c->best_energy < c->params.work.pass_gain * last && c->passes-- > 0 && c->work > 0) {
    last = c->best_energy;
    ORB_TRY(orb_map_register(c, c->params.registration.samples));
    if (!c->hierarchy) {
      ORB_TRY(orb_map_levels_prepare(c));
    }
    c->hopeless = c->params.work.far_above * c->best_energy;
    ORB_TRY(orb_map_run_start(c, ORB_MAP_SPATIAL));
    c->hopeless = INFINITY;
    if (draws && !(c->best_energy < last)) {
      ORB_TRY(orb_map_run_start(c, ORB_MAP_DRAWN));
    }
  }
  if (c->best_energy >= c->params.work.pass_gain * last) {
    c->settled = c->best_energy;
  }
  return ORB_OK;
}
