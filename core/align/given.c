/* Alignment by one method: each shape gets a working copy with the landmarks as vertices, the method runs, the result
 * is certified, and the composed map is improved. Soft landmarks are released at the end. If copies of large shapes
 * were aligned, the shapes then follow their copies. */
#include <math.h>
#include <string.h>

#include "align/find/match.h"
#include "align/find/params.h"
#include "align/map/engine/params.h"
#include "align/methods.h"
#include "align/pin/pin.h"
#include "align/rbf/rbf.h"
#include "align/rotate/rotate.h"
#include "align/sheet/even.h"
#include "align/sheet/landmarks.h"
#include "align/sheet/sheet.h"
#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "numeric/vec3.h"

static orb_status run_method(orb_context *ctx, orb_sheet *sheets, int32_t shape_count, const orb_landmark *landmarks,
                             int32_t landmark_count, const orb_align_options *options) {
  orb_status status = ORB_OK;
  int32_t unique_count = 0, *unique = ORB_NEW(ctx, int32_t, landmark_count);
  if (!unique) {
    return ORB_E_NO_MEMORY;
  }
  if (landmark_count > 0) {
    ORB_GO(status, orb_landmarks_distinct(ctx, sheets, shape_count, landmark_count, unique, &unique_count), end);
  }
  if (options->method == ORB_ALIGN_PIN || (options->method == ORB_ALIGN_AUTO && landmark_count > 0)) {
    status = orb_align_pin(ctx, sheets, shape_count, unique, unique_count, options);
  } else if (options->method == ORB_ALIGN_RBF) {
    status = orb_align_rbf(ctx, sheets, shape_count, landmarks, unique, unique_count, options);
  } else if (landmark_count > 0) {
    status = orb_rotate_by_landmarks(ctx, sheets, shape_count, unique, unique_count);
  } else {
    status = orb_rotate_by_search(ctx, sheets, shape_count);
  }
end:
  orb_free(ctx, unique);
  return status;
}

static orb_status certify_all(orb_context *ctx, orb_sheet *sheets, int32_t shape_count) {
  for (int32_t s = 0; s < shape_count; s++) {
    orb_aligned_shape *shape = &sheets[s].shape;
    ORB_TRY(orb_certify(ctx, shape->points, shape->mesh.vertex_count, shape->mesh.triangles, shape->mesh.triangle_count,
                        &shape->certificate));
    if (!shape->certificate.valid) {
      orb_status status = orb_fail(ctx, ORB_E_NOT_CERTIFIED, "The alignment of shape %d is not certified.", s);
      orb_context_error_edit(ctx)->shape = s;
      return status;
    }
  }
  return ORB_OK;
}

orb_status orb_compose_all(orb_context *ctx, orb_alignment *alignment, orb_map_from from, const orb_aims *aims,
                           orb_preset preset) {
  const orb_aims none = {0};
  double sum = 0;
  aims = aims ? aims : &none;
  for (int32_t s = 1; s < alignment->shape_count; s++) {
    const orb_map_guide guide = {.from = from,
                                 .target = aims->targets ? aims->targets[s] : NULL,
                                 .keeps_angles = aims->keep_angles,
                                 .beat = aims->beat,
                                 .course = aims->course,
                                 .walks_first = aims->walks_first};
    double energy[2];
    int improved;
    int both = alignment->shape_count == 2 && (alignment->landmark_count > 0 || aims->targets);
    ORB_TRY(orb_compose(ctx, &alignment->shapes[0], &alignment->shapes[s], both, alignment->landmark_count, &guide,
                        preset, energy, &improved));
    sum += energy[1];
  }
  alignment->energy = sum / (alignment->shape_count - 1);
  return ORB_OK;
}

static int is_soft(const orb_landmark *landmark) {
  return landmark->weight > 0 && landmark->weight < 1;
}

static int32_t count_soft(const orb_landmark *landmarks, int32_t count) {
  int32_t soft = 0;
  for (int32_t l = 0; l < count; l++) {
    soft += is_soft(&landmarks[l]);
  }
  return soft;
}

static orb_status springs_create(orb_context *ctx, int32_t count, orb_map_springs *out) {
  *out = (orb_map_springs){.moving = ORB_NEW(ctx, int32_t, count),
                           .fixed = ORB_NEW(ctx, int32_t, count),
                           .weight = ORB_NEW(ctx, double, count)};
  return out->moving && out->fixed && out->weight ? ORB_OK : ORB_E_NO_MEMORY;
}

static void springs_free(orb_context *ctx, orb_map_springs *springs) {
  orb_free(ctx, springs->moving);
  orb_free(ctx, springs->fixed);
  orb_free(ctx, springs->weight);
}

/* The springs between these vertices of the two shapes, one per landmark. */
static void set_springs(const orb_landmark *landmarks, int32_t count, const int32_t *fixed, const int32_t *moving,
                        orb_map_springs *out) {
  out->count = 0;
  for (int32_t l = 0; l < count; l++) {
    if (is_soft(&landmarks[l])) {
      out->fixed[out->count] = fixed[l];
      out->moving[out->count] = moving[l];
      out->weight[out->count++] = landmarks[l].weight / (1 - landmarks[l].weight);
    }
  }
}

/* Makes the soft landmarks of a shape ordinary vertices, which no other shape shares. */
static void free_landmarks(const orb_landmark *landmarks, int32_t count, orb_aligned_shape *shape) {
  for (int32_t l = 0; l < count; l++) {
    if (is_soft(&landmarks[l])) {
      shape->landmark_vertices[l] = -1;
    }
  }
}

/* Soft landmarks say where to look, not where to end. They were pinned with the others, so that the map takes each limb
 * to its limb. Now the map is composed once more with them free, and a spring pulls the places of each together. */
static orb_status soften(orb_context *ctx, const orb_landmark *landmarks, orb_preset preset, orb_alignment *alignment) {
  const int32_t count = alignment->landmark_count, soft = count_soft(landmarks, count);
  if (soft == 0 || alignment->shape_count < 2) {
    return ORB_OK;
  }
  orb_map_guide guide = {.from = ORB_MAP_FROM_PINS};
  orb_status status = springs_create(ctx, soft, &guide.springs);
  double sum = 0;
  for (int32_t s = 1; s < alignment->shape_count && status == ORB_OK; s++) {
    double energy[2];
    int improved;
    set_springs(landmarks, count, alignment->shapes[0].landmark_vertices, alignment->shapes[s].landmark_vertices,
                &guide.springs);
    free_landmarks(landmarks, count, &alignment->shapes[s]);
    ORB_GO(status,
           orb_compose(ctx, &alignment->shapes[0], &alignment->shapes[s], 0, count, &guide, preset, energy, &improved),
           end);
    sum += energy[1];
  }
  free_landmarks(landmarks, count, &alignment->shapes[0]);
  alignment->energy = sum / (alignment->shape_count - 1);
end:
  springs_free(ctx, &guide.springs);
  return status;
}

/* Working copies with the landmarks as vertices, aligned by one method and certified. */
static orb_status create(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                         const orb_landmark *landmarks, int32_t landmark_count, const orb_align_options *options,
                         orb_alignment *out) {
  orb_status status = ORB_OK;
  memset(out, 0, sizeof *out);
  orb_sheet *sheets = ORB_NEW0(ctx, orb_sheet, shape_count);
  out->shapes = ORB_NEW0(ctx, orb_aligned_shape, shape_count);
  out->shape_count = shape_count;
  out->landmark_count = landmark_count;
  out->energy = NAN;
  if (!sheets || !out->shapes) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  for (int32_t s = 0; s < shape_count; s++) {
    ORB_GO(status, orb_sheet_create(ctx, shapes[s].mesh, shapes[s].points, &sheets[s]), end);
    ORB_GO(status, orb_sheet_insert_landmarks(ctx, &sheets[s], landmarks, landmark_count, s), end);
  }
  ORB_GO(status, run_method(ctx, sheets, shape_count, landmarks, landmark_count, options), end);
  ORB_GO(status, certify_all(ctx, sheets, shape_count), end);
  for (int32_t s = 0; s < shape_count; s++) {
    orb_sheet_release(ctx, &sheets[s], &out->shapes[s]);
  }
end:
  for (int32_t s = 0; sheets && s < shape_count; s++) {
    orb_sheet_free(ctx, &sheets[s]);
  }
  orb_free(ctx, sheets);
  if (status != ORB_OK) {
    orb_alignment_free(ctx, out);
  }
  return status;
}

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
  const int32_t count = a->landmark_count, exact = count - count_soft(landmarks, count);
  int32_t next[2] = {0, exact};
  for (int32_t l = 0; l < count; l++) {
    const int32_t at = next[is_soft(&landmarks[l])]++;
    vertex[0][at] = a->shapes[0].landmark_vertices[l];
    vertex[1][at] = a->shapes[s].landmark_vertices[l];
  }
  return exact;
}

/* The result of a match before anything is pinned. */
typedef struct posed {
  orb_alignment alignment; /* empty, unless it is found */
  double worst;            /* the largest energy of its maps */
  int is_found;
  int is_unsure; /* 1: not found, because the landmarks leave open whether the shapes are one body */
} posed;

static void posed_free(orb_context *ctx, posed *p) {
  orb_alignment_free(ctx, &p->alignment);
  p->is_found = 0;
}

/* Composes the map to shape s towards a match that agrees with a few landmarks and that all of them draw to their
 * partners, with all of them pinned. Soft landmarks exclude matches only if too few are exact. sure: that of the hint.
 * Raises p->worst, to INFINITY if there is no such match, or no such map. */
static orb_status compose_posed(orb_context *ctx, const orb_landmark *landmarks, int32_t s, orb_preset preset,
                                double sure, int keeps_angles, posed *p) {
  orb_alignment *a = &p->alignment;
  orb_aligned_shape *fixed = &a->shapes[0], *moving = &a->shapes[s];
  const int32_t count = a->landmark_count;
  int32_t *vertex[2] = {ORB_NEW(ctx, int32_t, count), ORB_NEW(ctx, int32_t, count)};
  orb_match match = {0};
  double energies[2] = {INFINITY, INFINITY};
  int improved = 0;
  orb_status status = vertex[0] && vertex[1] ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto done;
  }
  const int32_t exact = list_landmarks(landmarks, a, s, vertex), spread = exact >= ORB_FIND_HINT_LEAST ? exact : count;
  ORB_GO(status, spread_landmarks(ctx, fixed->mesh.positions, spread, vertex), done);
  const orb_match_hint hint = {.count = count,
                               .few = spread < ORB_FIND_HINT_FEW ? spread : ORB_FIND_HINT_FEW,
                               .first = vertex[0],
                               .second = vertex[1],
                               .stretch = ORB_FIND_HINT_STRETCH_MOST,
                               .sure = sure};
  ORB_GO(status, orb_match_find(ctx, &fixed->mesh, &moving->mesh, &hint, &match), done);
  p->is_unsure |= match.is_unsure;
  if (match.is_found) {
    const orb_map_guide guide = {.from = ORB_MAP_FROM_SPACE, .target = match.target, .keeps_angles = keeps_angles};
    ORB_GO(status, orb_compose(ctx, fixed, moving, 0, count, &guide, preset, energies, &improved), done);
  }
  const double energy = improved ? energies[1] : INFINITY;
  a->energy += energy / (a->shape_count - 1);
  p->worst = fmax(p->worst, energy);
done:
  orb_match_free(ctx, &match);
  orb_free(ctx, vertex[0]);
  orb_free(ctx, vertex[1]);
  return status;
}

orb_status orb_align_are_alike(orb_context *ctx, orb_alignment *a, orb_preset preset, int *alike) {
  *alike = 1;
  for (int32_t s = 1; s < a->shape_count && *alike; s++) {
    double energy;
    ORB_TRY(orb_compose_energy(ctx, &a->shapes[0], &a->shapes[s], preset, &energy));
    *alike = energy <= ORB_FIND_ALIKE;
  }
  return ORB_OK;
}

static orb_status compose_all_posed(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                    const orb_landmark *landmarks, int32_t landmark_count,
                                    const orb_align_options *options, double sure, posed *p) {
  orb_align_options rotated = *options;
  rotated.method = ORB_ALIGN_ROTATE;
  orb_even_shapes even = {0};
  int alike;
  orb_status status;
  ORB_GO(status, create(ctx, shapes, shape_count, landmarks, landmark_count, &rotated, &p->alignment), end);
  ORB_GO(status, orb_align_are_alike(ctx, &p->alignment, options->preset, &alike), end);
  if (!alike) {
    orb_alignment_free(ctx, &p->alignment);
    ORB_GO(status, orb_even_shapes_create(ctx, shapes, shape_count, &even), end);
    ORB_GO(status, create(ctx, even.shapes, shape_count, landmarks, landmark_count, &rotated, &p->alignment), end);
  }
  p->alignment.energy = 0;
  for (int32_t s = 1; s < shape_count && p->worst < INFINITY && status == ORB_OK; s++) {
    status = compose_posed(ctx, landmarks, s, options->preset, sure, !alike, p);
  }
end:
  orb_even_shapes_free(ctx, &even);
  return status;
}

/* Aligns shapes that are one body in several poses. The map starts on spheres that keep angles, as without landmarks.
 * Pins would distort them: if a limb is long on one sphere and short on the other, true landmarks at its two ends fold
 * the surface between them. sure: that of orb_match_hint. Nothing is found if the landmarks do not show one body, if
 * there is no map, or if such a sphere has no room for a landmark; pins can meet if the given sphere has room. Free
 * `out` in any case. */
static orb_status align_posed(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                              const orb_landmark *landmarks, int32_t landmark_count, const orb_align_options *options,
                              double sure, posed *out) {
  memset(out, 0, sizeof *out);
  orb_status status = compose_all_posed(ctx, shapes, shape_count, landmarks, landmark_count, options, sure, out);
  out->is_found = status == ORB_OK && out->worst < INFINITY;
  if (!out->is_found) {
    posed_free(ctx, out);
  }
  return orb_alignment_lacks_room(ctx, status) ? ORB_OK : status;
}

/* A landmark walk of a pinned alignment of two shapes. *walked 0: it led to no map, or to no better one. */
static orb_status improve_by_walk(orb_context *ctx, orb_preset preset, orb_alignment *a, int *walked) {
  const orb_map_guide walk = {.from = ORB_MAP_FROM_WALK};
  double energies[2];
  ORB_TRY(orb_compose(ctx, &a->shapes[0], &a->shapes[1], 1, a->landmark_count, &walk, preset, energies, walked));
  a->energy = energies[1];
  return ORB_OK;
}

static void keep_better(orb_context *ctx, orb_alignment *a, posed *p) {
  if (p->is_found) {
    orb_alignment_keep_better(ctx, a, &p->alignment);
    p->is_found = 0;
  }
}

/* Improves a pinned alignment. A landmark walk is quick, and mostly as good as anything else. If its map is poor, a
 * match may lead to a better one, even if the landmarks show one body less clearly. All other starts are for shapes for
 * which neither works. p: the result of the match; if it was found, the better one is kept. */
static orb_status improve(orb_context *ctx, const orb_align_shape *shapes, const orb_landmark *landmarks,
                          const orb_align_options *options, posed *p, orb_alignment *a) {
  const orb_map_params params = orb_map_params_of(options->preset);
  const double good = params.energy.good, poor = params.energy.poor;
  int walked = 0;
  a->energy = INFINITY;
  if (a->shape_count == 2) {
    ORB_TRY(improve_by_walk(ctx, options->preset, a, &walked));
  }
  if (p->is_unsure && !p->is_found && a->energy > poor) {
    ORB_TRY(
        align_posed(ctx, shapes, a->shape_count, landmarks, a->landmark_count, options, ORB_FIND_HINT_STRETCH_MOST, p));
  }
  const int is_done = p->is_found ? fmin(a->energy, p->worst) <= ORB_FIND_POSED_POOR : walked || a->energy <= good;
  if (is_done) {
    keep_better(ctx, a, p);
  }
  if (options->preset == ORB_PRESET_QUALITY || !is_done) {
    ORB_TRY(orb_compose_all(ctx, a, ORB_MAP_FROM_SPACE, NULL, options->preset));
  }
  keep_better(ctx, a, p);
  return ORB_OK;
}

/* Whether a match makes pins needless. With more than two shapes, no walk competes with it. */
static int is_enough(const posed *p, int32_t shape_count, orb_preset preset) {
  const double most = shape_count > 2 ? ORB_FIND_POSED_POOR : orb_map_params_of(preset).energy.good;
  return p->is_found && preset != ORB_PRESET_QUALITY && p->worst <= most;
}

/* Aligns by landmarks. If they show one body in two poses, a match comes first: it knows the surface between the
 * landmarks, and if its map is good, nothing is pinned. For 35 pairs of animals of one kind, landmark walks with 8 true
 * landmarks have up to three times the error of matches without any. If the match's map is less good and the pins
 * cannot meet, it is kept: it takes each landmark to its partner too. */
static orb_status align_by_landmarks(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                     const orb_landmark *landmarks, int32_t landmark_count,
                                     const orb_align_options *options, orb_alignment *out) {
  posed p = {.is_found = 0};
  orb_status status = ORB_OK;
  memset(out, 0, sizeof *out);
  if (landmark_count >= ORB_FIND_HINT_LEAST) {
    ORB_TRY(align_posed(ctx, shapes, shape_count, landmarks, landmark_count, options, ORB_FIND_HINT_STRETCH, &p));
  }
  if (is_enough(&p, shape_count, options->preset)) {
    *out = p.alignment;
    return ORB_OK;
  }
  status = create(ctx, shapes, shape_count, landmarks, landmark_count, options, out);
  if (p.is_found && orb_alignment_lacks_room(ctx, status)) {
    *out = p.alignment;
    return ORB_OK;
  }
  if (status == ORB_OK) {
    status = improve(ctx, shapes, landmarks, options, &p, out);
  }
  posed_free(ctx, &p);
  return status;
}

/* Aligns by the method, then composes the maps. quick: first tries what leads to a good map soonest. */
static orb_status align_and_compose(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                    const orb_landmark *landmarks, int32_t landmark_count,
                                    const orb_align_options *options, int quick, orb_alignment *out) {
  const int composes =
      options->preset != ORB_PRESET_FAST && (options->method == ORB_ALIGN_PIN || options->method == ORB_ALIGN_AUTO);
  orb_status status;
  if (composes && quick && landmark_count > 0 && shape_count > 1) {
    status = align_by_landmarks(ctx, shapes, shape_count, landmarks, landmark_count, options, out);
  } else {
    status = create(ctx, shapes, shape_count, landmarks, landmark_count, options, out);
    if (status == ORB_OK && composes) {
      status = orb_compose_all(ctx, out, ORB_MAP_FROM_SPACE, NULL, options->preset);
    }
  }
  if (status == ORB_OK) {
    status = soften(ctx, landmarks, options->preset, out);
  }
  if (status != ORB_OK) {
    orb_alignment_free(ctx, out);
  }
  return status;
}

orb_status orb_align_given(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                           const orb_landmark *landmarks, int32_t landmark_count, const orb_align_options *options,
                           orb_alignment *out) {
  return align_and_compose(ctx, shapes, shape_count, landmarks, landmark_count, options, 1, out);
}

orb_status orb_align_pinned(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                            const orb_landmark *landmarks, int32_t landmark_count, const orb_align_options *options,
                            orb_alignment *out) {
  return align_and_compose(ctx, shapes, shape_count, landmarks, landmark_count, options, 0, out);
}

/* Refines the map of the copy of shape s, and replaces the copy by the whole shape. *energy: INFINITY if there is no
 * map; both shapes then stay as they are. */
static orb_status lift_shape(orb_context *ctx, orb_copied_shape *copied, const orb_landmark *landmarks, int32_t s,
                             orb_preset preset, orb_alignment *alignment, double *energy) {
  const int32_t count = alignment->landmark_count;
  orb_aligned_shape *fixed = &alignment->shapes[0], *whole = &copied->whole;
  orb_map_guide guide = {
      .from = ORB_MAP_FROM_COPY,
      .copy = {copied->copy.mesh.vertex_count, copied->copy.vertex, alignment->shapes[s].points, &copied->hierarchy}};
  double energies[2];
  int improved = 0;
  orb_status status;
  ORB_GO(status, springs_create(ctx, count_soft(landmarks, count), &guide.springs), end);
  set_springs(landmarks, count, fixed->landmark_vertices, whole->landmark_vertices, &guide.springs);
  free_landmarks(landmarks, count, whole);
  ORB_GO(status, orb_compose(ctx, fixed, whole, 0, count, &guide, preset, energies, &improved), end);
  *energy = improved ? energies[1] : INFINITY;
  if (improved) {
    orb_aligned_shape_free(ctx, &alignment->shapes[s]);
    alignment->shapes[s] = *whole;
    memset(whole, 0, sizeof *whole);
  }
end:
  springs_free(ctx, &guide.springs);
  return status;
}

/* The places of alternatives are at vertices of the copies. Moves them to the same vertices of the whole shapes.
 */
static orb_status lift_alternatives(orb_context *ctx, const orb_copies *copies, orb_alignment *alignment) {
  for (int32_t i = 0; i < alignment->alternative_count; i++) {
    orb_alternative *one = &alignment->alternatives[i];
    for (int32_t k = 0; k < one->count * alignment->shape_count; k++) {
      ORB_TRY(orb_copies_lift_vertex(ctx, copies, k % alignment->shape_count, &one->at[k]));
    }
  }
  return ORB_OK;
}

orb_status orb_align_lift(orb_context *ctx, orb_copies *copies, const orb_landmark *landmarks, orb_preset preset,
                          orb_alignment *alignment, int *lifted) {
  double sum = 0;
  orb_status status;
  *lifted = 0;
  ORB_GO(status, lift_alternatives(ctx, copies, alignment), end);
  for (int32_t s = 1; s < alignment->shape_count && sum < INFINITY; s++) {
    double energy = INFINITY;
    ORB_GO(status, lift_shape(ctx, &copies->of[s], landmarks, s, preset, alignment, &energy), end);
    sum += energy;
  }
  free_landmarks(landmarks, alignment->landmark_count, &alignment->shapes[0]);
  alignment->energy = sum / (alignment->shape_count - 1);
  *lifted = sum < INFINITY;
end:
  if (!*lifted) {
    orb_alignment_free(ctx, alignment);
  }
  return status;
}
