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
 * - From the best map so far, drawn to the spatial targets (engine/rounds.c).
 *
 * If spatial targets are given, other starts are used, and limbs are untwisted only at the end (targets.h). Then the
 * map slides to where the shapes fit each other in space (space/slide.h), or it is drawn to where a part does
 * (space/part.h).
 *
 * Each start (start.h) is then refined up to all vertices, and no flip is allowed again. The map of least energy wins
 * if it is better than the alignment as given. Limbs that it has twisted are untwisted (twist/untwist.c), once before
 * the moving shape is registered again through samples of it, and once at the end.
 *
 * A large shape is not moved as a whole: it is the fixed one, or a decimated copy of it has its map already, which is
 * refined (lifted.c).
 *
 * Soft landmarks are pinned first, as all are. Then they are released, and springs hold them instead.
 */
#include "align/map/compose.h"

#include <math.h>
#include <string.h>

#include "align/map/engine/rounds.h"
#include "align/map/engine/run.h"
#include "align/map/engine/step.h"
#include "align/map/levels.h"
#include "align/map/lifted.h"
#include "align/map/space/part.h"
#include "align/map/space/slide.h"
#include "align/map/start.h"
#include "align/map/starts/landmark_walk.h"
#include "align/map/starts/place.h"
#include "align/map/starts/spectral_samples.h"
#include "align/map/swap.h"
#include "align/map/targets.h"
#include "align/map/twist/untwist.h"
#include "align/map/walked.h"
#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"

static void orb_map_run_free(orb_map_run *c) {
  orb_context *ctx = c->ctx;
  orb_map_surface_free(ctx, &c->b);
  orb_map_packed_free(ctx, &c->packed);
  orb_free(ctx, c->x);
  orb_free(ctx, c->normal);
  orb_free(ctx, c->target);
  orb_free(ctx, c->target_normal);
  orb_free(ctx, c->target_place);
  orb_free(ctx, c->doubted);
  orb_free(ctx, c->keep);
  orb_free(ctx, c->usable);
  orb_hierarchy_destroy(ctx, c->hierarchy);
  orb_free(ctx, c->position);
  orb_free(ctx, c->local);
  orb_free(ctx, c->place);
  orb_free(ctx, c->start);
  orb_free(ctx, c->best);
  orb_free(ctx, c->fixed_points);
  orb_free(ctx, c->kept.points);
  orb_free(ctx, c->kept.fixed);
  orb_free(ctx, c->pairs.moving);
  orb_free(ctx, c->pairs.fixed);
}

static orb_status prepare(orb_map_run *c) {
  orb_context *ctx = c->ctx;
  const orb_mesh *mesh = &c->moving->mesh;
  size_t n = (size_t)mesh->vertex_count;
  c->vertex_count = mesh->vertex_count;
  ORB_TRY(orb_map_surface_create(ctx, c->fixed, &c->b));
  ORB_TRY(orb_map_packed_create(ctx, &c->fixed->mesh, &c->b, &c->packed));
  c->x = ORB_NEW(ctx, double, 3 * n);
  c->normal = ORB_NEW(ctx, double, 3 * n);
  c->keep = ORB_NEW0(ctx, unsigned char, n);
  c->usable = ORB_NEW0(ctx, unsigned char, n);
  c->position = ORB_NEW(ctx, double, 3 * n);
  c->local = ORB_NEW(ctx, int32_t, n);
  c->place = ORB_NEW0(ctx, orb_place, n);
  c->start = ORB_NEW(ctx, double, 3 * n);
  c->best = ORB_NEW(ctx, double, 3 * n);
  c->target = ORB_NEW(ctx, double, 3 * n);
  c->target_normal = ORB_NEW(ctx, double, 3 * n);
  c->target_place = ORB_NEW(ctx, orb_place, n);
  c->doubted = ORB_NEW0(ctx, unsigned char, n);
  if (!c->x || !c->normal || !c->keep || !c->usable || !c->position || !c->local || !c->place || !c->start ||
      !c->best || !c->target || !c->target_normal || !c->target_place || !c->doubted) {
    return ORB_E_NO_MEMORY;
  }
  orb_extent extent;
  orb_mesh_extent(mesh, &extent);
  double scale = extent.area > 0 ? sqrt(4 * M_PI / extent.area) : 1;
  for (size_t i = 0; i < 3 * n; i++) {
    c->x[i] = (mesh->positions[i] - 0.5 * extent.min[i % 3] - 0.5 * extent.max[i % 3]) * scale;
  }
  orb_map_normals(c->x, mesh->vertex_count, mesh->triangles, mesh->triangle_count, c->normal);
  memcpy(c->start, c->moving->points, 3 * n * sizeof *c->start);
  return ORB_OK;
}

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

/* Optimises the map as given, which keeps its limbs where they are. Drops mirror landmarks: they would hold what must
 * be let go.
 */
static orb_status let_go(orb_map_run *c) {
  c->pairs.count = c->pairs.landmarks;
  c->params.work.rough = 0;
  ORB_TRY(orb_map_levels_prepare(c));
  return orb_map_run_start(c, ORB_MAP_GIVEN);
}

/* Should the map slide? Yes, if it is good, or begins with targets on spheres that keep angles. A landmark walk of
 * shapes of other kinds is no good map, and stays; so does a walk that came first because the shapes bend much: of 14
 * such pairs and 20 of animals, none fitted in space. */
static int should_slide(const orb_map_run *c, orb_map_from from) {
  if (c->walks_first && c->course.is_walked) {
    return 0;
  }
  return (c->given_target || from == ORB_MAP_FROM_WALK) &&
         (c->best_energy <= c->params.energy.good || (c->given_target && c->keeps_angles));
}

/* Writes the best map back if it is better than the alignment as given, or fits parts, and is certified. */
static orb_status take_best(orb_map_run *c, orb_aligned_shape *fixed, double energy[2], int *improved) {
  orb_aligned_shape *shapes[2] = {c->moving, fixed};
  orb_map_candidate best = {c->best, c->fixed_points, c->best_energy};
  orb_certificate certificate[2] = {{.valid = 1}, {.valid = 1}};
  best = !c->fits_part && c->kept.points && c->kept.energy <= best.energy ? c->kept : best;
  const double *points[2] = {best.points, best.fixed};
  if (!c->fits_part && !(best.energy < energy[0])) {
    return ORB_OK;
  }
  for (int s = 0; s < 2; s++) {
    const orb_mesh *mesh = &shapes[s]->mesh;
    if (points[s]) {
      ORB_TRY(
          orb_certify(c->ctx, points[s], mesh->vertex_count, mesh->triangles, mesh->triangle_count, &certificate[s]));
    }
  }
  *improved = certificate[0].valid && certificate[1].valid;
  for (int s = 0; s < 2 && *improved; s++) {
    if (points[s]) {
      memcpy(shapes[s]->points, points[s], 3 * (size_t)shapes[s]->mesh.vertex_count * sizeof *points[s]);
      shapes[s]->certificate = certificate[s];
      energy[1] = best.energy;
    }
  }
  return ORB_OK;
}

orb_status orb_compose_energy(orb_context *ctx, orb_aligned_shape *fixed, orb_aligned_shape *moving, orb_preset preset,
                              double *energy) {
  orb_map_run c = {.ctx = ctx, .params = orb_map_params_of(preset), .fixed = fixed, .moving = moving};
  orb_status status;
  ORB_GO(status, prepare(&c), done);
  status = orb_map_energy_of(&c, moving->points, c.params.energy.cap, energy);
done:
  orb_map_run_free(&c);
  return status;
}

/* A run of these two shapes. */
static orb_map_run run_of(orb_context *ctx, orb_aligned_shape *fixed, orb_aligned_shape *moving, int both,
                          int32_t landmark_count, const orb_map_guide *guide, orb_preset preset) {
  const orb_map_params params = orb_map_params_of(preset);
  return (orb_map_run){.ctx = ctx,
                       .params = params,
                       .fixed = fixed,
                       .moving = moving,
                       .both = both,
                       .landmark_count = landmark_count,
                       .given_target = guide->target,
                       .keeps_angles = guide->keeps_angles,
                       .beat = guide->beat,
                       .rival = guide->rival,
                       .wants_course = guide->course != NULL,
                       .walks_first = guide->walks_first && both,
                       .walks_early = guide->walks_early && both,
                       .springs = guide->springs,
                       .hopeless_flips = params.clear.hopeless,
                       .passes = params.work.passes,
                       .work = params.work.all * (int64_t)moving->mesh.vertex_count,
                       .hopeless = INFINITY,
                       .settled = INFINITY,
                       .twisted_energy = INFINITY};
}

/* Measures the map as given and finds the pairs. energy: as of orb_compose(), both of the map as given. */
static orb_status open_run(orb_map_run *c, const orb_map_guide *guide, double energy[2]) {
  const orb_aligned_shape *moving = c->moving;
  ORB_TRY(prepare(c));
  energy[0] = INFINITY;
  if (guide->from != ORB_MAP_FROM_COPY) {
    ORB_TRY(orb_map_energy_of(c, moving->points, c->params.energy.cap, &energy[0]));
  }
  memcpy(c->best, moving->points, 3 * (size_t)moving->mesh.vertex_count * sizeof *c->best);
  c->best_energy = energy[0];
  ORB_TRY(orb_map_pairs_create(c));
  if ((guide->target && c->pairs.landmarks > 0) /* the landmarks are apart */ || guide->from == ORB_MAP_FROM_SPRINGS) {
    energy[0] = c->best_energy = INFINITY;
  }
  energy[1] = energy[0];
  return ORB_OK;
}

static int is_hopeless(const orb_map_run *c) {
  return c->course.is_beaten || (c->given_target && c->best_energy > c->params.targets.hopeless);
}

/* Draws the map to where parts of the shapes fit in space, or slides where that may help. before: the energy of the map
 * as given. */
static orb_status fit_in_space(orb_map_run *c, orb_map_from from, double before) {
  int is_part;
  ORB_TRY(orb_map_is_part(c, &is_part));
  if (is_part) {
    return orb_map_fit_part(c);
  }
  return should_slide(c, from) ? orb_map_slide(c, before) : ORB_OK;
}

static orb_status untwist_and_fit(orb_map_run *c, orb_map_from from, double before) {
  if (is_hopeless(c) || (from == ORB_MAP_FROM_WALK && !(c->best_energy < before))) {
    return ORB_OK;
  }
  ORB_TRY(orb_map_untwist(c, INFINITY));
  return fit_in_space(c, from, before);
}

orb_status orb_compose(orb_context *ctx, orb_aligned_shape *fixed, orb_aligned_shape *moving, int both,
                       int32_t landmark_count, const orb_map_guide *guide, orb_preset preset, double energy[2],
                       int *improved) {
  const orb_map_params params = orb_map_params_of(preset);
  int swap = 0;
  *improved = 0;
  if (both && !guide->target && fixed->mesh.vertex_count <= params.copies.large) {
    ORB_TRY(orb_map_should_swap(ctx, &params, fixed, moving, &swap));
  }
  if (swap) {
    orb_aligned_shape *other = fixed;
    fixed = moving;
    moving = other;
  }
  orb_map_run c = run_of(ctx, fixed, moving, both, landmark_count, guide, preset);
  orb_status status;
  ORB_GO(status, open_run(&c, guide, energy), done);
  if (guide->from == ORB_MAP_FROM_PINS || guide->from == ORB_MAP_FROM_SPRINGS) {
    ORB_GO(status, let_go(&c), done);
  } else if (guide->from == ORB_MAP_FROM_COPY) {
    ORB_GO(status, orb_map_lift(&c, &guide->copy), done);
  } else {
    ORB_GO(status, run(&c, guide->from, preset), done);
    ORB_GO(status, untwist_and_fit(&c, guide->from, energy[0]), done);
  }
  if (guide->course) {
    ORB_GO(status, orb_map_energy_of(&c, c.best, c.params.energy.bulk, &c.course.bulk), done);
    *guide->course = c.course;
  }
  status = take_best(&c, fixed, energy, improved);
done:
  orb_map_run_free(&c);
  return status;
}

struct orb_map_draft {
  orb_map_run run;
  orb_map_walked walked;
  orb_aligned_shape *fixed;
  double *target;   /* what fits best in space, if no target was given */
  double energy[2]; /* as of orb_compose() */
};

/* Gives the run the target that fits best in space. */
static orb_status aim_in_space(orb_map_draft *d) {
  orb_map_run *c = &d->run;
  const size_t count = 3 * (size_t)c->vertex_count;
  d->target = ORB_NEW(c->ctx, double, count);
  if (!d->target) {
    return ORB_E_NO_MEMORY;
  }
  ORB_TRY(orb_map_register(c, 0));
  for (size_t i = 0; i < count; i++) {
    d->target[i] = c->target[i] / c->b.scale + c->b.centre[i % 3];
  }
  c->given_target = d->target;
  return ORB_OK;
}

orb_status orb_map_draft_create(orb_context *ctx, orb_aligned_shape *fixed, orb_aligned_shape *moving,
                                const double *target, double known, orb_preset preset, orb_map_draft **out,
                                double *energy) {
  const orb_map_guide guide = {.target = target, .keeps_angles = 1, .walks_first = 1};
  orb_map_draft *d = *out = ORB_NEW0(ctx, orb_map_draft, 1);
  if (!d) {
    return ORB_E_NO_MEMORY;
  }
  d->run = run_of(ctx, fixed, moving, 1, 0, &guide, preset);
  d->fixed = fixed;
  ORB_TRY(open_run(&d->run, &guide, d->energy));
  if (!target) {
    ORB_TRY(aim_in_space(d));
  }
  d->run.beat.energy = known < INFINITY ? known : 0; /* fewer walks are then tried */
  ORB_TRY(orb_map_target_walks(&d->run, &d->walked));
  d->run.beat.energy = 0;
  *energy = d->walked.energy;
  return ORB_OK;
}

orb_status orb_map_draft_finish(orb_context *ctx, orb_map_draft *d, double *energy) {
  d->run.ctx = ctx;
  d->run.drafted = &d->walked;
  ORB_TRY(orb_map_follow_targets(&d->run));
  *energy = fmin(d->run.best_energy, d->energy[0]);
  return ORB_OK;
}

orb_status orb_map_draft_take(orb_context *ctx, orb_map_draft *d, double *energy) {
  int improved = 0;
  d->run.ctx = ctx;
  if (!is_hopeless(&d->run)) {
    ORB_TRY(fit_in_space(&d->run, ORB_MAP_FROM_SPACE, d->energy[0]));
  }
  ORB_TRY(take_best(&d->run, d->fixed, d->energy, &improved));
  *energy = d->energy[1];
  return ORB_OK;
}

void orb_map_draft_free(orb_context *ctx, orb_map_draft *d) {
  if (d) {
    d->run.ctx = ctx;
    orb_map_walked_free(&d->run, &d->walked);
    orb_map_run_free(&d->run);
    orb_free(ctx, d->target);
    orb_free(ctx, d);
  }
}
