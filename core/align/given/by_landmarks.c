/* Alignment by landmarks. If one of two shapes is a part of the other one, what lies on each other is held. Otherwise
 * two ways compete: pins (pin/), and a match (find/match.c) that the landmarks draw to their partners. Whichever leads
 * to the better map wins. One body in two poses has its limbs where a match has them. Shapes of other kinds take the
 * match as a guide, if pins alone lead to no map or to a poor one, or if the landmarks leave limbs open. */
#include <math.h>
#include <stdatomic.h>
#include <string.h>

#include "align/find/contest.h"
#include "align/find/match.h"
#include "align/find/params.h"
#include "align/given/part.h"
#include "align/map/engine/params.h"
#include "align/methods.h"
#include "align/sheet/even.h"
#include "align/sheet/landmarks.h"
#include "align/sheet/sheet.h"
#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

/* Orders the landmarks so that each is as far as possible from those before it, on the first shape. vertex: theirs on
 * two shapes. O(landmarks²). */
static orb_status spread_landmarks(orb_context *ctx, const double *positions, int32_t count, int32_t *vertex[2]) {
  double *far = ORB_NEW(ctx, double, count);
  if (!far) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < count; i++) {
    int32_t best = i;
    for (int32_t l = i; l < count; l++) {
      const double *p = positions + 3 * (size_t)vertex[0][l];
      far[l] = i == 0 ? INFINITY : fmin(far[l], orb_distance2(p, positions + 3 * (size_t)vertex[0][i - 1]));
      best = far[l] > far[best] ? l : best;
    }
    far[best] = far[i];
    for (int s = 0; s < 2; s++) {
      const int32_t chosen = vertex[s][best];
      vertex[s][best] = vertex[s][i];
      vertex[s][i] = chosen;
    }
  }
  orb_free(ctx, far);
  return ORB_OK;
}

/* The landmarks of the first shape and of shape s: first those that are exact, spread, then those that are soft.
 * Returns the number of the exact ones. */
static int32_t list_landmarks(const orb_landmark *landmarks, const orb_alignment *a, int32_t s, int32_t *vertex[2]) {
  const int32_t count = a->landmark_count, exact = count - orb_landmarks_soft(landmarks, count);
  int32_t next[2] = {0, exact};
  for (int32_t l = 0; l < count; l++) {
    const int32_t at = next[orb_landmark_is_soft(&landmarks[l])]++;
    vertex[0][at] = a->shapes[0].landmark_vertices[l];
    vertex[1][at] = a->shapes[s].landmark_vertices[l];
  }
  return exact;
}

/* The result of a match before anything is pinned. */
typedef struct posed {
  orb_alignment alignment; /* empty, unless it is found or waits for a second try */
  int keeps_angles;        /* its spheres do */
  double worst, loose;     /* the largest energy of its maps, and the mean, before they are fitted in space */
  int is_found;
  int is_unsure;   /* 1: not found, because the landmarks leave open whether the shapes are one body */
  int is_unlike;   /* 1: the landmarks exclude it, whether it is found or not */
  int leaves_open; /* 1: the landmarks exclude it, and say nothing of several limbs */
} posed;

static void posed_free(orb_context *ctx, posed *p) {
  orb_alignment_free(ctx, &p->alignment);
  p->is_found = 0;
}

/* What the two ways share. */
typedef struct two_ways {
  orb_context *ctx;
  const orb_align_shape *shapes;
  int32_t shape_count;
  const orb_landmark *landmarks;
  int32_t landmark_count;
  const orb_align_options *options;
  posed posed;
  orb_alignment pinned; /* once has_tried_pins; empty if the pins have no room */
  double loose;         /* the energy of its map before that is fitted in space */
  int has_tried_pins, lacks_room;
  int fits_part;   /* that map is drawn to where parts of the shapes fit, so its energy does not compare */
  int walked;      /* the pins of two shapes meet in a map that a landmark walk has led to */
  int seeks_part;  /* look whether one of two shapes is a part of the other one */
  orb_inset inset; /* it is: there is nothing else to try then */
} two_ways;

/* Two shapes have two ways, unless the map is to be refined as far as it goes. */
static int have_two(const two_ways *c) {
  return c->shape_count == 2 && c->options->preset != ORB_PRESET_QUALITY;
}

/* Pins the landmarks, and improves the alignment of two shapes by a landmark walk. Its energy is INFINITY without one.
 */
static orb_status try_pins(two_ways *c) {
  orb_alignment *a = &c->pinned;
  if (c->has_tried_pins) {
    return ORB_OK;
  }
  c->has_tried_pins = 1;
  orb_status status =
      orb_align_by_method(c->ctx, c->shapes, c->shape_count, c->landmarks, c->landmark_count, c->options, a);
  c->lacks_room = orb_alignment_lacks_room(c->ctx, status);
  if (status != ORB_OK) {
    return c->lacks_room ? ORB_OK : status;
  }
  a->energy = c->loose = INFINITY;
  if (c->shape_count == 2) {
    orb_map_course course = {0};
    const orb_map_guide walk = {.from = ORB_MAP_FROM_WALK, .fits_parts = 1, .course = &course};
    double energies[2];
    ORB_TRY(orb_compose(c->ctx, &a->shapes[0], &a->shapes[1], 1, a->landmark_count, &walk, c->options->preset, energies,
                        &c->walked));
    a->energy = energies[1];
    c->loose = fmin(energies[1], course.loose);
    c->fits_part = course.fits_part;
  }
  return ORB_OK;
}

/* Is a pose whose first map has this energy worth more work? Not if the pins have a clearly better one. */
static orb_status ask_pins(void *user, double energy, int *goes_on) {
  two_ways *c = user;
  ORB_TRY(try_pins(c));
  const double poor = orb_map_params_of(c->options->preset).energy.poor;
  *goes_on = !c->walked || c->loose > poor || c->loose > ORB_FIND_POSED_BEATEN * energy;
  return ORB_OK;
}

/* What the pose of one shape has led to. Without a match, or without a map, the energies are INFINITY. */
typedef struct posed_map {
  double energy, loose; /* loose: before the map is fitted in space */
  int is_unsure, is_unlike, leaves_open;
} posed_map;

/* Shapes that are composed side by side. If one has no map, those after it do not count, and are left out. */
typedef struct posing {
  two_ways *ways;
  double sure;            /* that of the hint */
  posed_map *map;         /* of each shape but the first */
  atomic_int first_empty; /* the first of them so far that has none; their number: all have one */
} posing;

/* Follows a match from its targets. Pins compete with it where there are two ways. */
static orb_status follow_targets(orb_context *ctx, two_ways *c, int32_t s, orb_match *match, posed_map *out) {
  orb_alignment *a = &c->posed.alignment;
  const int competes = have_two(c), walks_first = competes && match->bend > ORB_FIND_WALKS_FIRST;
  orb_map_course course = {0};
  double energies[2];
  int improved;
  orb_map_aim aim;
  ORB_TRY(orb_match_aim(ctx, match, &aim));
  const orb_map_guide guide = {.from = ORB_MAP_FROM_SPACE,
                               .target = match->target,
                               .aim = aim,
                               .fits_parts = 1,
                               .keeps_angles = c->posed.keeps_angles,
                               .course = &course,
                               .rival = {competes ? ask_pins : NULL, c},
                               .beat = {.energy = walks_first && c->walked ? c->loose : 0},
                               .walks_first = walks_first};
  ORB_TRY(orb_compose(ctx, &a->shapes[0], &a->shapes[s], walks_first, a->landmark_count, &guide, c->options->preset,
                      energies, &improved));
  out->energy = improved ? energies[1] : INFINITY;
  out->loose = improved ? fmin(energies[1], course.loose) : INFINITY;
  return ORB_OK;
}

/* Follows a match by walks, on spheres that keep angles. Either shape may move: of 84 pairs of animals of other kinds
 * with 8 landmarks, 14 whose second one always moved had more energy, by up to a half, and one had less. */
static orb_status follow_by_walks(orb_context *ctx, two_ways *c, const orb_match *match, posed_map *out) {
  orb_alignment *a = &c->posed.alignment;
  orb_contest_result won;
  ORB_TRY(orb_contest_run(ctx, match, a->landmark_count, c->walked ? c->loose : INFINITY, c->options->preset, a, &won));
  out->energy = a->energy;
  out->loose = fmin(won.loose, a->energy);
  return ORB_OK;
}

/* Finds a match that agrees with a few landmarks and that all of them draw to their partners. Soft landmarks exclude
 * matches only if too few are exact. walks: see orb_match_find(). */
static orb_status find_posed(orb_context *ctx, const posing *all, int32_t s, int walks, orb_match *match) {
  const two_ways *c = all->ways;
  const orb_alignment *a = &c->posed.alignment;
  const int32_t count = a->landmark_count;
  int32_t *vertex[2] = {ORB_NEW(ctx, int32_t, count), ORB_NEW(ctx, int32_t, count)};
  orb_status status = vertex[0] && vertex[1] ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto done;
  }
  const int32_t exact = list_landmarks(c->landmarks, a, s, vertex);
  const int32_t spread = exact >= ORB_FIND_HINT_LEAST ? exact : count;
  ORB_GO(status, spread_landmarks(ctx, a->shapes[0].mesh.positions, spread, vertex), done);
  const orb_match_hint hint = {.count = count,
                               .trusted = spread,
                               .few = spread < ORB_FIND_HINT_FEW ? spread : ORB_FIND_HINT_FEW,
                               .first = vertex[0],
                               .second = vertex[1],
                               .stretch = fmax(ORB_FIND_HINT_STRETCH_MOST, all->sure),
                               .sure = all->sure,
                               .seeks_part = c->seeks_part && c->shape_count == 2,
                               .asks_limbs = have_two(c)};
  status = orb_match_find(ctx, &a->shapes[0].mesh, &a->shapes[s].mesh, &hint, walks, match);
done:
  orb_free(ctx, vertex[0]);
  orb_free(ctx, vertex[1]);
  return status;
}

/* Composes the map to a shape towards its match, with all landmarks pinned. Several shapes share nothing that they
 * write: only two shapes have pins. */
static orb_status compose_posed(orb_context *ctx, const posing *all, int32_t i) {
  two_ways *c = all->ways;
  const int32_t s = i + 1;
  posed_map *out = &all->map[i];
  const int walks = have_two(c);
  orb_match match = {0};
  orb_status status;
  *out = (posed_map){.energy = INFINITY, .loose = INFINITY};
  ORB_GO(status, find_posed(ctx, all, s, walks, &match), done);
  out->is_unsure = match.is_unsure;
  out->is_unlike = match.is_unlike;
  out->leaves_open = match.leaves_open;
  if (c->seeks_part && match.inset.count > 0) {
    c->inset = match.inset;
  } else if (match.is_found) {
    status = walks && orb_contest_is_open(&match, c->posed.keeps_angles) ? follow_by_walks(ctx, c, &match, out)
                                                                         : follow_targets(ctx, c, s, &match, out);
  }
done:
  orb_match_free(ctx, &match);
  return status;
}

static void note_empty(posing *all, int32_t i) {
  int first = atomic_load(&all->first_empty);
  while (i < first && !atomic_compare_exchange_weak(&all->first_empty, &first, i)) {
  }
}

/* What those after an empty one lead to does not count, errors included: how many have begun depends on the threads. */
static orb_status compose_unless_empty(orb_context *ctx, void *arg, int32_t i) {
  posing *all = arg;
  if (atomic_load(&all->first_empty) < i) {
    return ORB_OK;
  }
  const orb_status status = compose_posed(ctx, all, i);
  if (status == ORB_OK && !(all->map[i].loose < INFINITY)) {
    note_empty(all, i);
  }
  return atomic_load(&all->first_empty) < i ? ORB_OK : status;
}

/* Composes the maps to all shapes but the first. */
static orb_status compose_to_all(two_ways *c, double sure) {
  posed *p = &c->posed;
  const int32_t count = c->shape_count - 1;
  posing all = {c, sure, ORB_NEW0(c->ctx, posed_map, count), count};
  orb_status status =
      all.map ? orb_align_each(c->ctx, &p->alignment.shapes[0], c->options->preset, count, compose_unless_empty, &all)
              : ORB_E_NO_MEMORY;
  p->alignment.energy = 0;
  for (int32_t i = 0; i < count && i <= atomic_load(&all.first_empty) && status == ORB_OK; i++) {
    p->alignment.energy += all.map[i].energy / count;
    p->loose += all.map[i].loose / count;
    p->worst = fmax(p->worst, all.map[i].loose);
    p->is_unsure |= all.map[i].is_unsure;
    p->is_unlike |= all.map[i].is_unlike;
    p->leaves_open |= all.map[i].leaves_open;
  }
  orb_free(c->ctx, all.map);
  return status;
}

/* Rotates the spheres onto each other: the given ones if they are alike then, or else spheres that keep angles. */
static orb_status rotate_posed(two_ways *c) {
  orb_context *ctx = c->ctx;
  posed *p = &c->posed;
  orb_align_options rotated = *c->options;
  rotated.method = ORB_ALIGN_ROTATE;
  orb_even_shapes even = {0};
  int alike;
  orb_status status;
  ORB_GO(status,
         orb_align_by_method(ctx, c->shapes, c->shape_count, c->landmarks, c->landmark_count, &rotated, &p->alignment),
         end);
  ORB_GO(status, orb_align_are_alike(ctx, &p->alignment, rotated.preset, &alike), end);
  p->keeps_angles = !alike;
  if (!alike) {
    orb_alignment_free(ctx, &p->alignment);
    ORB_GO(status, orb_even_shapes_create(ctx, c->shapes, c->shape_count, &even), end);
    status =
        orb_align_by_method(ctx, even.shapes, c->shape_count, c->landmarks, c->landmark_count, &rotated, &p->alignment);
  }
end:
  orb_even_shapes_free(ctx, &even);
  return status;
}

/* Aligns shapes by their matches. The map starts on spheres that keep angles, as without landmarks. Pins would distort
 * them: if a limb is long on one sphere and short on the other, true landmarks at its two ends fold the surface between
 * them. sure: that of orb_match_hint. Nothing is found if the shapes are less alike, if there is no map, or if such a
 * sphere has no room for a landmark; pins can meet if the given sphere has room. Two shapes for which it finds
 * nothing because landmarks leave it open or exclude it stay rotated, for a second try. */
static orb_status try_pose(two_ways *c, double sure) {
  posed *p = &c->posed;
  *p = (posed){.alignment = p->alignment, .keeps_angles = p->keeps_angles};
  orb_status status = p->alignment.shapes ? ORB_OK : rotate_posed(c);
  if (status == ORB_OK) {
    status = compose_to_all(c, sure);
  }
  p->is_found = status == ORB_OK && p->worst < INFINITY;
  const int may_wait = status == ORB_OK && c->shape_count == 2 && (p->is_unsure || p->is_unlike);
  if (!p->is_found && !may_wait) {
    posed_free(c->ctx, p);
  }
  return orb_alignment_lacks_room(c->ctx, status) ? ORB_OK : status;
}

/* Leaves the better of the two in c->pinned. Energies compare as long as maps are not fitted in space, and one of the
 * two may be fitted alone. */
static void keep_better(two_ways *c) {
  posed *p = &c->posed;
  if (!p->is_found) {
    return;
  }
  if (p->loose < c->loose) {
    orb_alignment_free(c->ctx, &c->pinned);
    c->pinned = p->alignment;
    c->loose = p->loose;
    memset(&p->alignment, 0, sizeof p->alignment);
  }
  posed_free(c->ctx, p);
}

/* Looks for a match again, if there was none and the pins' map is poor, or not good while limbs are open. Landmarks
 * that leave open whether the shapes are one body may then be those of one after all. Landmarks that exclude it still
 * exclude wrong matches. What they leave guides walks in four cases: the pins meet in no map; its energy is above LED;
 * there are fewer landmarks than a body has limbs, and it is above energy.poor; or they say nothing of several limbs.
 * With 5, 14 of 83 pairs of animals of other kinds then have more than 5 % less error, and 4 more than 5 % more. */
static orb_status try_pose_again(two_ways *c) {
  const orb_map_params params = orb_map_params_of(c->options->preset);
  const posed *p = &c->posed;
  if (p->is_found || c->loose <= (p->leaves_open ? params.energy.good : params.energy.poor)) {
    return ORB_OK;
  }
  if (p->is_unsure) {
    return try_pose(c, ORB_FIND_HINT_STRETCH_MOST);
  }
  const int is_led = c->walked && c->loose <= ORB_FIND_POSED_LED && c->landmark_count >= ORB_FIND_HINT_FEW;
  return have_two(c) && p->is_unlike && (p->leaves_open || !is_led) ? try_pose(c, INFINITY) : ORB_OK;
}

/* Is what the pins or the match have led to as good as other starts? */
static int ends_right(const two_ways *c) {
  const double pins = c->loose, pose = c->posed.worst;
  const int agree = c->walked && fabs(pose - pins) <= ORB_FIND_POSED_AGREE * pins;
  return fmin(pins, pose) <= ORB_FIND_POSED_POOR || agree || (have_two(c) && pose <= ORB_FIND_POSED_LOST);
}

/* Improves a pinned alignment. A landmark walk is quick, and mostly as good as anything else. If its map is poor, or
 * limbs are open, a match may lead to a better one. All other starts are for shapes for which neither works. */
static orb_status improve(two_ways *c) {
  const orb_preset preset = c->options->preset;
  const orb_map_params params = orb_map_params_of(preset);
  const double good = params.energy.good;
  posed *p = &c->posed;
  if (c->fits_part) {
    posed_free(c->ctx, p);
    return ORB_OK;
  }
  ORB_TRY(try_pose_again(c));
  if (c->inset.count > 0) {
    return ORB_OK;
  }
  const int is_done = p->is_found ? ends_right(c) : c->walked || c->loose <= good;
  if (is_done) {
    keep_better(c);
  }
  if (preset == ORB_PRESET_QUALITY || !is_done) {
    const double before = c->pinned.energy;
    ORB_TRY(orb_compose_all(c->ctx, &c->pinned, ORB_MAP_FROM_SPACE, NULL, preset));
    c->loose = c->pinned.energy < before ? c->pinned.energy : c->loose;
  }
  keep_better(c);
  return ORB_OK;
}

/* Whether a match makes pins needless. With more than two shapes, no walk competes with it. */
static int is_enough(const two_ways *c) {
  const double most =
      c->shape_count > 2 ? ORB_FIND_POSED_POOR : orb_map_params_of(c->options->preset).targets.contested;
  return c->posed.is_found && c->options->preset != ORB_PRESET_QUALITY && c->posed.worst <= most;
}

static orb_status hold(two_ways *c) {
  ORB_TRY(try_pose(c, ORB_FIND_HINT_STRETCH));
  if (c->inset.count > 0 || is_enough(c)) {
    return ORB_OK;
  }
  ORB_TRY(try_pins(c));
  return c->lacks_room ? ORB_OK : improve(c);
}

/* The better of the two ways. inset: NULL, or it is filled if one shape is a part of the other one; `out` is empty
 * then. */
static orb_status align_two_ways(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                 const orb_landmark *landmarks, int32_t landmark_count,
                                 const orb_align_options *options, orb_inset *inset, orb_alignment *out) {
  two_ways c = {.ctx = ctx,
                .shapes = shapes,
                .shape_count = shape_count,
                .landmarks = landmarks,
                .landmark_count = landmark_count,
                .options = options,
                .seeks_part = inset != NULL};
  orb_status status = hold(&c);
  orb_alignment *winner = c.posed.is_found ? &c.posed.alignment : &c.pinned;
  memset(out, 0, sizeof *out);
  if (status == ORB_OK && c.inset.count > 0) {
    *inset = c.inset;
  } else if (status == ORB_OK && winner->shapes) {
    *out = *winner;
    memset(winner, 0, sizeof *winner);
  } else if (status == ORB_OK) { /* again, for the error */
    status = orb_align_by_method(ctx, shapes, shape_count, landmarks, landmark_count, options, out);
  }
  orb_alignment_free(ctx, &c.pinned);
  posed_free(ctx, &c.posed);
  return status;
}

/* Aligns a part and its whole: what lies on each other in space is held, after the landmarks. A map of least energy
 * would spread the part over the whole. `out` stays empty if the pairs cannot be met, or if their map is bad. */
static orb_status align_part(orb_context *ctx, const orb_align_shape *shapes, const orb_landmark *landmarks,
                             int32_t landmark_count, const orb_align_options *options, const orb_inset *inset,
                             orb_alignment *out) {
  orb_align_options pin = *options;
  orb_part_landmarks all;
  orb_status status;
  pin.max_growth = 1e-9; /* practically none: pairs that were found are not worth splits */
  ORB_GO(status, orb_part_landmarks_create(ctx, shapes, landmarks, landmark_count, inset, &all), end);
  if (all.count > landmark_count) {
    status = align_two_ways(ctx, shapes, 2, all.landmark, all.count, &pin, NULL, out);
    status = orb_alignment_lacks_room(ctx, status) ? ORB_OK : status;
  }
  if (out->shapes && !(out->energy <= ORB_FIND_INSET_MOST_ENERGY)) {
    orb_alignment_free(ctx, out);
  }
end:
  orb_part_landmarks_free(ctx, &all);
  return status;
}

/* A match comes first, unless the landmarks show that the shapes are not one body in two poses. It knows the surface
 * between the landmarks, and if its map has little energy, nothing is pinned. For 35 pairs of animals of one kind,
 * landmark walks with 8 true landmarks have up to three times the error of matches without any. If the match's map is
 * less good and the pins cannot meet, it is kept: it takes each landmark to its partner too. */
orb_status orb_align_by_landmarks(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                  const orb_landmark *landmarks, int32_t landmark_count,
                                  const orb_align_options *options, orb_alignment *out) {
  orb_inset inset = {0};
  ORB_TRY(align_two_ways(ctx, shapes, shape_count, landmarks, landmark_count, options, &inset, out));
  if (inset.count > 0) {
    ORB_TRY(align_part(ctx, shapes, landmarks, landmark_count, options, &inset, out));
  }
  return inset.count == 0 || out->shapes
             ? ORB_OK
             : align_two_ways(ctx, shapes, shape_count, landmarks, landmark_count, options, NULL, out);
}
