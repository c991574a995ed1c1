/* The composed map.
 *
 * Two embeddings that are each optimal do not correspond: the look of a morph depends on the map from one shape to the
 * other. So the embedding of the fixed shape is kept. The moving shape is decimated, with its landmarks kept, and
 * refined anew. Every vertex has a place on the fixed shape and moves there by Newton steps of the symmetric Dirichlet
 * energy of the composed map (engine/step.c). Of two shapes, the one whose triangles can follow the other one moves
 * (swap.c).
 *
 * Mirror landmarks join the landmarks if both shapes are symmetric and no targets are given (starts/mirror.c). They are
 * held like landmarks, unless a start is nearly a map with them and a better map without them.
 *
 * If landmarks show one body in two poses, the caller first gives spatial targets that take them near their partners
 * (targets.c). Otherwise, or if that map is not good, it asks for the quick way (walked.c): a landmark walk, optimised
 * on a coarse level and refined. If neither gives a map, there are three kinds of starts:
 * - From spatial targets: the moving shape after non-rigid registration in space (starts/registration.c), which
 *   samples by eigenfunctions guide where they agree with the landmarks (starts/spectral_samples.c). This is good where
 *   it folds little. Flips are allowed against a growing barrier until untangling clears nearly all; collapses clear
 *   the last ones (engine/unfold.c). The usable part of a start that is nearly a map serves a later walk
 *   (engine/near.c).
 * - As given, or after a landmark walk of the landmarks, mirror landmarks and some samples of the spatial targets
 *   (starts/landmark_walk.c). It has no flips from the beginning.
 * - From the best map so far, drawn to the spatial targets (engine/loosen.c).
 *
 * If spatial targets are given, other starts are used, and limbs are untwisted only at the end (targets.h). Then the
 * map slides to where the shapes fit each other in space (space/slide.h), or it is drawn to where a part does
 * (space/part.h), even if it had less energy before.
 *
 * Each start (start.h) is then refined up to all vertices, and no flip is allowed again. The map of least energy wins
 * if it is better than the alignment as given. Limbs that it has twisted are untwisted (twist/untwist.c), once before
 * the moving shape is registered again through samples of it, and once at the end.
 *
 * A large shape is not moved as a whole: it is the fixed one, or a decimated copy of it has its map already, which is
 * refined, with its vertices held where they are (lifted.c).
 *
 * Soft landmarks are pinned first, as all are. Then they are released, and springs hold them instead.
 */
#include "align/map/compose.h"

#include <math.h>
#include <string.h>

#include "align/map/engine/run.h"
#include "align/map/levels.h"
#include "align/map/lifted.h"
#include "align/map/space/part.h"
#include "align/map/start.h"
#include "align/map/starts/landmark_walk.h"
#include "align/map/starts/place.h"
#include "align/map/starts/spectral_samples.h"
#include "align/map/swap.h"
#include "align/map/targets.h"
#include "align/map/twist/untwist.h"
#include "align/map/walked.h"
#include "align/map/whole.h"
#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"

/* Walks to a map in which all pairs meet: through many samples if they are usable, else through few or none. */
static orb_status walk_pairs(orb_map_run *c, int *stuck) {
  const int32_t samples[] = {c->params.walk.usable_samples, c->params.walk.samples, 0};
  *stuck = 1;
  for (int i = c->has_usable ? 0 : 1; i < 3 && c->pairs.count > 0 && *stuck; i++) {
    ORB_TRY(orb_map_landmark_walk(c, samples[i], stuck));
  }
  return ORB_OK;
}

/* Makes a map in which all pairs meet, for the starts that need one, by a landmark walk. If it finds none, drops the
 * mirror landmarks. */
static orb_status meet_pairs(orb_map_run *c) {
  int stuck;
  ORB_TRY(walk_pairs(c, &stuck));
  if (!stuck || c->pairs.count == c->pairs.landmarks) {
    return ORB_OK;
  }
  c->pairs.count = c->pairs.landmarks;
  if (c->has_usable) {
    ORB_TRY(walk_pairs(c, &stuck));
  }
  if (stuck) {
    memcpy(c->start, c->moving->points, 3 * (size_t)c->vertex_count * sizeof *c->start);
  }
  ORB_TRY(orb_map_register(c, 0));
  return orb_map_levels_prepare(c);
}

/* Untwists limbs before the moving shape is registered again through samples of the best map: spatial targets that
 * follow a twist keep it. If that helps, the registrations that follow get some work again. */
static orb_status untwist_early(orb_map_run *c, double most_kept) {
  double twisted = c->best_energy;
  int64_t least = c->params.work.untwisted * (int64_t)c->vertex_count;
  ORB_TRY(orb_map_untwist(c, most_kept));
  c->work = c->best_energy < twisted && c->work < least ? least : c->work;
  return ORB_OK;
}

/* A rough map of high energy that is thin halfway through the morph has twisted limbs: it folds when it is drawn to its
 * spatial targets, and samples of it are twisted too. So limbs are untwisted before it is drawn. If that does not help,
 * the work stays for the draws. */
static orb_status untwist_first(orb_map_run *c) {
  double before = c->best_energy;
  int64_t work = c->work;
  if (before <= c->params.untwist.early_energy) {
    return ORB_OK;
  }
  ORB_TRY(untwist_early(c, c->params.untwist.early_kept));
  c->work = c->best_energy < before ? c->work : work;
  return ORB_OK;
}

/* After a start from spatial targets that is nearly a map: one more without the mirror landmarks. A mirror landmark
 * that is a little off its true place folds what the landmarks alone do not. If the new start is no better, everything
 * is restored. */
static orb_status start_without_mirror_landmarks(orb_map_run *c) {
  orb_context *ctx = c->ctx;
  size_t n = (size_t)c->vertex_count;
  int32_t count = c->pairs.count;
  double before = c->best_energy;
  unsigned char *usable = ORB_NEW(ctx, unsigned char, n);
  orb_place *place = ORB_NEW(ctx, orb_place, n);
  orb_status status = usable && place ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto done;
  }
  memcpy(usable, c->usable, n);
  memcpy(place, c->target_place, n * sizeof *place);
  c->pairs.count = c->pairs.landmarks;
  ORB_GO(status, orb_map_register(c, 0), done);
  ORB_GO(status, orb_map_levels_prepare(c), done);
  ORB_GO(status, orb_map_run_start(c, ORB_MAP_SPATIAL), done);
  if (c->best_energy < before) {
    goto done; /* the mirror landmarks stay dropped */
  }
  c->pairs.count = count;
  ORB_GO(status, orb_map_register(c, 0), done);
  ORB_GO(status, orb_map_levels_prepare(c), done);
  memcpy(c->usable, usable, n);
  memcpy(c->target_place, place, n * sizeof *place);
  c->has_usable = 1;
done:
  orb_free(ctx, usable);
  orb_free(ctx, place);
  return status;
}

/* From spatial targets. */
static orb_status run_spatial(orb_map_run *c) {
  ORB_TRY(orb_map_run_start(c, ORB_MAP_SPATIAL));
  if (c->has_usable && c->pairs.count > c->pairs.landmarks && c->best_energy > c->params.energy.good) {
    ORB_TRY(start_without_mirror_landmarks(c));
  }
  return ORB_OK;
}

/* Runs the starts, until they bring no improvement or the work is spent. */
static orb_status run_starts(orb_map_run *c, orb_map_from from, orb_preset preset) {
  double good = c->params.energy.good;
  ORB_TRY(orb_map_register(c, from == ORB_MAP_FROM_MAP ? c->params.registration.samples : 0));
  ORB_TRY(orb_map_levels_prepare(c));
  ORB_TRY(run_spatial(c));
  if (preset != ORB_PRESET_QUALITY && c->best_energy <= good) {
    return ORB_OK;
  }
  ORB_TRY(meet_pairs(c));
  ORB_TRY(orb_map_run_start(
      c, ORB_MAP_GIVEN)); /* without flips and cheap; the better it is, the better the later ones are */
  ORB_TRY(untwist_first(c));
  ORB_TRY(orb_map_run_start(c, ORB_MAP_DRAWN));
  ORB_TRY(untwist_early(c, INFINITY));
  return orb_map_run_passes(c, 1);
}

/* A landmark walk, refined to all vertices unless it has twisted limbs. */
static orb_status run_walk(orb_map_run *c) {
  orb_map_walked walked;
  orb_status status = orb_map_walked_create(c, 0, &walked);
  if (status == ORB_OK && walked.energy < INFINITY) {
    status = orb_map_walked_refine(c, &walked);
  }
  orb_map_walked_free(c, &walked);
  return status;
}

/* Chooses the starts by what the map as given says. */
static orb_status run(orb_map_run *c, orb_map_from from, orb_preset preset) {
  /* A good map without landmarks is kept: symmetric shapes have others that are as good. */
  if (c->pairs.landmarks == 0 && !c->keeps_angles && c->best_energy <= c->params.energy.good) {
    ORB_TRY(orb_map_levels_prepare(c));
    return orb_map_run_start(c, ORB_MAP_GIVEN);
  }
  if (c->given_target) {
    return orb_map_follow_targets(c);
  }
  if (from == ORB_MAP_FROM_WALK) {
    return run_walk(c);
  }
  if (from == ORB_MAP_FROM_SPACE) {
    ORB_TRY(orb_map_spectral_samples(c));
  }
  return run_starts(c, from, preset);
}

/* Optimises the map as given, which keeps its limbs where they are. */
static orb_status let_go(orb_map_run *c) {
  c->params.work.rough = 0;
  ORB_TRY(orb_map_levels_prepare(c));
  return orb_map_run_start(c, ORB_MAP_GIVEN);
}

orb_status orb_compose_energy(orb_context *ctx, orb_aligned_shape *fixed, orb_aligned_shape *moving, orb_preset preset,
                              double *energy) {
  orb_map_run c = {.ctx = ctx, .params = orb_map_params_of(preset), .fixed = fixed, .moving = moving};
  orb_status status;
  ORB_GO(status, orb_map_run_prepare(&c), done);
  status = orb_map_energy_of(&c, moving->points, c.params.energy.cap, energy);
done:
  orb_map_run_free(&c);
  return status;
}

/* The last steps. before: the energy of the map as given. */
static orb_status untwist_and_fit(orb_map_run *c, orb_map_from from, double before) {
  c->course.loose = fmin(c->best_energy, c->kept.points ? c->kept.energy : INFINITY);
  if (orb_map_run_is_hopeless(c) || (from == ORB_MAP_FROM_WALK && !(c->best_energy < before))) {
    return ORB_OK;
  }
  ORB_TRY(orb_map_untwist(c, INFINITY));
  c->course.loose = fmin(c->course.loose, c->best_energy);
  return orb_map_run_fit(c, from, before);
}

/* Should the shapes change places? A part moves better onto its whole than the other way: what it is not to cover has
 * room around it. With 24 landmarks, what the draw of a bust to a head leaves behind is the neck. */
static orb_status choose_moving(orb_context *ctx, const orb_map_params *params, const orb_aligned_shape *fixed,
                                const orb_aligned_shape *moving, int32_t landmark_count, int *swap) {
  orb_map_part part;
  ORB_TRY(orb_map_find_part(ctx, params, fixed, moving, landmark_count, &part));
  *swap = part == ORB_MAP_PART_IS_FIXED;
  return part == ORB_MAP_NO_PART ? orb_map_should_swap(ctx, params, fixed, moving, swap) : ORB_OK;
}

orb_status orb_compose(orb_context *ctx, orb_aligned_shape *fixed, orb_aligned_shape *moving, int both,
                       int32_t landmark_count, const orb_map_guide *guide, orb_preset preset, double energy[2],
                       int *improved) {
  const orb_map_params params = orb_map_params_of(preset);
  int swap = 0;
  *improved = 0;
  if (both && !guide->target && fixed->mesh.vertex_count <= params.copies.large) {
    ORB_TRY(choose_moving(ctx, &params, fixed, moving, guide->fits_parts ? landmark_count : 0, &swap));
  }
  if (swap) {
    orb_aligned_shape *other = fixed;
    fixed = moving;
    moving = other;
  }
  orb_map_run c = orb_map_run_of(ctx, fixed, moving, both, landmark_count, guide, preset);
  orb_status status;
  ORB_GO(status, orb_map_run_open(&c, guide, energy), done);
  if (guide->from == ORB_MAP_FROM_PINS || guide->from == ORB_MAP_FROM_SPRINGS) {
    ORB_GO(status, let_go(&c), done);
    ORB_GO(status, orb_map_run_fit(&c, guide->from, energy[0]), done);
  } else if (guide->from == ORB_MAP_FROM_COPY) {
    ORB_GO(status, orb_map_lift(&c, &guide->copy), done);
    if (guide->copy.lets_go) { /* parts no longer lie where the copy has fitted them */
      ORB_GO(status, orb_map_run_fit(&c, guide->from, energy[0]), done);
    }
  } else {
    ORB_GO(status, run(&c, guide->from, preset), done);
    ORB_GO(status, untwist_and_fit(&c, guide->from, energy[0]), done);
  }
  if (c.wants_course) {
    ORB_GO(status, orb_map_energy_of(&c, c.best, c.params.energy.bulk, &c.course.bulk), done);
  }
  if (guide->course) {
    *guide->course = c.course;
  }
  status = orb_map_run_take(&c, fixed, energy, improved);
done:
  orb_map_run_free(&c);
  return status;
}
