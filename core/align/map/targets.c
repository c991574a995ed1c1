/* Without landmarks, the targets are smoothed first, by a registration in space through samples of them, if the first
 * level then has fewer flips. A start from them is nearly always a map, landmarks held: unfolding (engine/unfold.h)
 * clears the remaining flips. Where the targets are folded, the map is crumpled, for example in the pockets of a face
 * and where limbs touch. If it is crumpled much, it begins anew on a coarser level, where folds have fewer triangles.
 * It is ironed (engine/iron.h) and drawn to the targets at once, which smooths most crumples. A further draw brings the
 * energy down, unless the last one has brought little. With `quality` passes through samples of the map come before it:
 * they may find a better basin, and a draw only the bottom of one.
 *
 * If that gives no map of shapes that correspond, samples of the targets guide landmark walks (walked.h). A walk begins
 * without flips and is optimised on a coarse level, so several are tried, and the best one is refined. Such shapes are
 * of other kinds, and a map of least energy shares a neck and a head out over a trunk by length alone; so all targets
 * hold the map, and no pass follows, which would let it go. If the caller says so, a walk comes first, and replaces all
 * starts: of 30 pairs of other kinds, it led to the map that was kept in 22. Or it comes after the first start, if that
 * leads to a poor map, and before that is drawn.
 *
 * Rejected, where the first start leads to a poor map: passes, a start on a coarser level, and one from the targets
 * that the first one has not followed. Of 284 pairs of real meshes, animals and people without landmarks, 22 came to
 * the first and 17 to the others, which took 0.6 s each. None gained. Of 108 with landmarks, none came to them. */
#include "align/map/targets.h"

#include <math.h>

#include "align/map/levels.h"
#include "align/map/start.h"
#include "align/map/starts/place.h"
#include "align/map/walked.h"
#include "base/check.h"

/* Each step gets its own work: a start that is given up must not starve the next. */
static void allow(orb_map_run *c) {
  orb_map_allow(c, c->params.targets.work);
}

/* The energy up to which a map is not improved. */
static double good_energy(const orb_map_run *c) {
  return c->keeps_angles ? c->params.energy.good : c->params.targets.alike;
}

/* The energy up to which a map from a start is not improved. Landmarks hold crumples that other maps lose, and a map
 * with landmarks is then worth more time, unless a slide follows, which smooths crumples too. */
static double smooth_energy(const orb_map_run *c) {
  return c->pairs.landmarks > 0 && !c->keeps_angles ? c->params.targets.alike : good_energy(c);
}

/* Spatial targets from a registration through samples of the given ones. These come from decimated copies, and are
 * noisy where the shapes are finer, as in fingers: a start from them crumples there, and how much is close to chance.
 */
static orb_status smooth_targets(orb_map_run *c) {
  c->samples_follow_target = 1;
  orb_status status = orb_map_register(c, c->params.registration.samples);
  c->samples_follow_target = 0;
  return status;
}

/* Sets the smooth targets. *given, *smooth: the flips of a start from the targets as they were, and from these. */
static orb_status try_smooth_targets(orb_map_run *c, int32_t *given, int32_t *smooth) {
  ORB_TRY(orb_map_start_flips(c, given));
  ORB_TRY(smooth_targets(c));
  return orb_map_start_flips(c, smooth);
}

/* Sets the targets of the first start: the smooth ones, or those as given if they fold it less, for example if limbs
 * lie beside each other and a registration in space moves them together. Walks take samples of the targets themselves.
 * Targets drawn by landmarks stay as given, unless the map crumples: smooth ones fold most starts of people with
 * landmarks more. */
static orb_status register_first(orb_map_run *c) {
  int32_t given, smooth;
  ORB_TRY(orb_map_register(c, 0));
  if (c->walks_first) { /* walks have levels of their own */
    return ORB_OK;
  }
  ORB_TRY(orb_map_levels_prepare(c));
  if (c->pairs.landmarks > 0) {
    return ORB_OK;
  }
  ORB_TRY(try_smooth_targets(c, &given, &smooth));
  c->starts_smooth = smooth < given;
  return c->starts_smooth ? ORB_OK : orb_map_register(c, 0);
}

/* From the targets on a coarser level. Folds have fewer triangles there, and leave fewer crumples. */
static orb_status start_coarser(orb_map_run *c) {
  const int32_t usual = c->params.level.spatial;
  allow(c);
  c->params.level.spatial = c->params.level.given;
  orb_status status = orb_map_run_start(c, ORB_MAP_SPATIAL);
  c->params.level.spatial = usual;
  return status;
}

/* The first start from targets. If its folds leave it crumpled, a coarser one comes first, from the targets as given:
 * from smooth ones, a horse and a dog came to 1.31, from these to 1.20. A crumpled start of the next best match is
 * given up: of seven that began coarser, one led to a better map, by 0.5 %. */
static orb_status start_spatial(orb_map_run *c) {
  const double before = c->best_energy;
  c->crumpled = c->params.targets.folded;
  orb_status status = orb_map_run_start(c, ORB_MAP_SPATIAL);
  c->crumpled = INFINITY;
  if (status != ORB_OK || !c->is_crumpled || c->beat.energy > 0) {
    return status;
  }
  ORB_TRY(orb_map_register(c, 0));
  ORB_TRY(start_coarser(c));
  if (c->best_energy < before) {
    return ORB_OK;
  }
  allow(c);
  if (c->starts_smooth) {
    ORB_TRY(smooth_targets(c));
  }
  return orb_map_run_start(c, ORB_MAP_SPATIAL);
}

orb_status orb_map_target_walks(orb_map_run *c, orb_map_walked *out) {
  *out = (orb_map_walked){.energy = INFINITY};
  ORB_TRY(register_first(c));
  return orb_map_walked_improve(c, out);
}

/* From walks that the targets guide: the best of them is refined if it comes near the best map so far or below, and
 * below what the caller knows. Refined, it often has less energy. */
static orb_status start_guided(orb_map_run *c) {
  const double before = c->best_energy;
  orb_map_walked best = {.energy = INFINITY};
  orb_status status = ORB_OK;
  if (c->drafted) {
    best = *c->drafted;
    *c->drafted = (orb_map_walked){.energy = INFINITY};
    c->drafted = NULL;
  } else {
    ORB_GO(status, orb_map_walked_improve(c, &best), done);
  }
  if (best.energy < c->params.walked.refines * c->best_energy &&
      !(c->beat.energy > 0 && best.energy >= c->beat.energy)) {
    allow(c);
    ORB_GO(status, orb_map_walked_refine(c, &best), done);
  }
  if (!(c->best_energy < before) && !(c->walks_first && c->beat.energy > 0)) { /* other starts follow */
    status = orb_map_levels_prepare(c);
  }
done:
  orb_map_walked_free(c, &best);
  return status;
}

static orb_status draw(orb_map_run *c) {
  const double before = c->best_energy;
  allow(c);
  ORB_TRY(orb_map_run_start(c, ORB_MAP_DRAWN));
  c->last_draw.energy = c->best_energy;
  c->last_draw.share = c->best_energy / before;
  return ORB_OK;
}

static orb_status run_passes(orb_map_run *c) {
  allow(c);
  return orb_map_run_passes(c, 0);
}

/* A start from smooth targets, for a first map with landmarks whose energy lies in few triangles: the landmarks draw
 * the targets as given, from which thin parts such as fingers may crumple. Smooth targets that fold the start
 * clearly more than those as given never helped. Of man and woman with 24 landmarks, which leave the fingers out, one
 * hand had its fingers on other fingers, and half of the energy. */
static orb_status start_smooth(orb_map_run *c) {
  const double before = c->best_energy;
  int32_t given, smooth;
  ORB_TRY(try_smooth_targets(c, &given, &smooth));
  if (smooth <= c->params.targets.smooth_flips * given) {
    allow(c);
    ORB_TRY(orb_map_run_start(c, ORB_MAP_SPATIAL));
  }
  return c->best_energy < before ? ORB_OK : orb_map_register(c, 0);
}

/* Notes the energy that most triangles of the first map have, and starts anew if few have much more. */
static orb_status measure_first(orb_map_run *c, int walked) {
  double *bulk = &c->course.first_bulk;
  ORB_TRY(orb_map_energy_of(c, c->best, c->params.energy.bulk, bulk));
  const double energy = c->best_energy;
  const int is_crumpled =
      energy - 1 > c->params.targets.uneven * (*bulk - 1) && energy - *bulk > c->params.targets.crumple;
  if (walked || c->walks_first || c->pairs.landmarks == 0 || energy > c->params.energy.poor || !is_crumpled) {
    return ORB_OK;
  }
  ORB_TRY(start_smooth(c));
  return c->best_energy < energy ? orb_map_energy_of(c, c->best, c->params.energy.bulk, bulk) : ORB_OK;
}

/* The first start. *walked: it is a walk. */
static orb_status run_first(orb_map_run *c, int *walked) {
  const double given = c->best_energy;
  if (!c->drafted) {
    ORB_TRY(register_first(c));
  }
  if (c->walks_first) {
    ORB_TRY(start_guided(c));
  }
  *walked = c->best_energy < given;
  if (!*walked && !(c->walks_first && c->beat.energy > 0)) {
    ORB_TRY(start_spatial(c));
  }
  orb_map_course *course = &c->course;
  course->is_walked = *walked;
  if (c->wants_course) {
    ORB_TRY(measure_first(c, *walked));
  }
  const int is_map = c->walks_first ? *walked : c->best_energy < given;
  course->is_beaten = c->beat.energy > 0 && (!is_map || (!c->walks_first && !(course->first_bulk < c->beat.bulk)));
  return ORB_OK;
}

/* Asks the rival whether the best map is worth more work. */
static orb_status ask_rival(orb_map_run *c) {
  int goes_on;
  ORB_TRY(c->rival.ask(c->rival.user, c->best_energy, &goes_on));
  c->course.is_beaten = !goes_on;
  return ORB_OK;
}

/* Continues from the first start, unless the rival has a better map. A first map of much energy is often beaten, so the
 * rival is asked before it is drawn. */
static orb_status continue_first(orb_map_run *c) {
  const orb_map_params *p = &c->params;
  const int asks_first = c->rival.ask && c->best_energy > p->targets.asked_first;
  if (asks_first) {
    ORB_TRY(ask_rival(c));
    if (c->course.is_beaten) {
      return ORB_OK;
    }
  }
  if (c->best_energy > smooth_energy(c) && c->best_energy <= p->targets.crumpled) {
    ORB_TRY(draw(c));
  }
  const int asks_now = c->rival.ask && !asks_first && c->best_energy > p->targets.contested;
  return asks_now ? ask_rival(c) : ORB_OK;
}

/* A walk, if starts have led to no map of shapes that correspond. *walked: it leads to the best map. */
static orb_status walk_towards(orb_map_run *c, int *walked) {
  const double before = c->best_energy;
  ORB_TRY(orb_map_register(c, 0));
  ORB_TRY(start_guided(c));
  *walked = c->best_energy < before;
  return ORB_OK;
}

/* Continues from the map of the first start: passes with `quality`, then a draw to the bottom of the basin, unless the
 * last draw has led to this map and brought little. */
static orb_status improve_started(orb_map_run *c) {
  const orb_map_params *p = &c->params;
  const double started = c->best_energy;
  if (started <= smooth_energy(c) || started > p->targets.hopeless) {
    return ORB_OK;
  }
  if (p->targets.passes) {
    ORB_TRY(run_passes(c));
  }
  const int has_settled = !(c->best_energy < c->last_draw.energy) && c->last_draw.share > p->targets.gain;
  if (c->best_energy <= smooth_energy(c) || c->best_energy > p->targets.drawn || has_settled) {
    return ORB_OK;
  }
  if (!(c->best_energy < started)) {
    ORB_TRY(orb_map_register(c, 0));
  }
  return draw(c);
}

orb_status orb_map_follow_targets(orb_map_run *c) {
  int walked;
  ORB_TRY(run_first(c, &walked));
  if (c->course.is_beaten) {
    return ORB_OK;
  }
  if (!walked && c->walks_early && !c->walks_first && c->best_energy > c->params.targets.walked) {
    ORB_TRY(walk_towards(c, &walked));
    if (!walked && c->starts_smooth) {
      ORB_TRY(smooth_targets(c));
    }
  }
  if (!walked) {
    ORB_TRY(continue_first(c));
    if (c->course.is_beaten) {
      return ORB_OK;
    }
    if (c->both && !c->walks_first && !c->walks_early && c->best_energy > c->params.targets.walked) {
      ORB_TRY(walk_towards(c, &walked));
    }
  }
  return walked ? ORB_OK : improve_started(c);
}
