/* Alignment by one method: each shape gets a working copy with the landmarks as vertices, the method runs, the result
 * is certified, and the composed map is improved. Soft landmarks are let go at the end. */
#include <math.h>
#include <string.h>

#include "align/find/match.h"
#include "align/find/params.h"
#include "align/map/engine/params.h"
#include "align/methods.h"
#include "align/pin/pin.h"
#include "align/rbf/rbf.h"
#include "align/rotate/rotate.h"
#include "align/sheet/landmarks.h"
#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"

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

orb_status orb_compose_all(orb_context *ctx, orb_alignment *alignment, orb_map_from from, const double *const *targets,
                           orb_preset preset) {
  double sum = 0;
  for (int32_t s = 1; s < alignment->shape_count; s++) {
    const orb_map_guide guide = {.from = from, .target = targets ? targets[s] : NULL};
    double energy[2];
    int improved;
    int both = alignment->shape_count == 2 && (alignment->landmark_count > 0 || from == ORB_MAP_FROM_WALKS);
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

/* The springs between the first shape and shape s. */
static void set_springs(const orb_landmark *landmarks, const orb_alignment *a, int32_t s, orb_map_springs *out) {
  out->count = 0;
  for (int32_t l = 0; l < a->landmark_count; l++) {
    if (is_soft(&landmarks[l])) {
      out->fixed[out->count] = a->shapes[0].landmark_vertices[l];
      out->moving[out->count] = a->shapes[s].landmark_vertices[l];
      out->weight[out->count++] = landmarks[l].weight / (1 - landmarks[l].weight);
    }
  }
}

/* From here on the soft landmarks of a shape are no vertices that others share. */
static void free_landmarks(const orb_landmark *landmarks, int32_t count, orb_aligned_shape *shape) {
  for (int32_t l = 0; l < count; l++) {
    if (is_soft(&landmarks[l])) {
      shape->landmark_vertices[l] = -1;
    }
  }
}

/* Soft landmarks say where to look, not where to end. They were pinned with the others, so that the map takes each limb
 * to its limb. Now the map is composed once more with them free, and a spring draws the places of each together. */
static orb_status soften(orb_context *ctx, const orb_landmark *landmarks, orb_preset preset, orb_alignment *alignment) {
  const int32_t count = alignment->landmark_count;
  int32_t soft = 0;
  for (int32_t l = 0; l < count; l++) {
    soft += is_soft(&landmarks[l]);
  }
  if (soft == 0 || alignment->shape_count < 2) {
    return ORB_OK;
  }
  orb_map_guide guide = {.from = ORB_MAP_FROM_PINS,
                         .springs = {.moving = ORB_NEW(ctx, int32_t, soft),
                                     .fixed = ORB_NEW(ctx, int32_t, soft),
                                     .weight = ORB_NEW(ctx, double, soft)}};
  orb_map_springs *springs = &guide.springs;
  orb_status status = springs->moving && springs->fixed && springs->weight ? ORB_OK : ORB_E_NO_MEMORY;
  double sum = 0;
  for (int32_t s = 1; s < alignment->shape_count && status == ORB_OK; s++) {
    double energy[2];
    int improved;
    set_springs(landmarks, alignment, s, springs);
    free_landmarks(landmarks, count, &alignment->shapes[s]);
    ORB_GO(status,
           orb_compose(ctx, &alignment->shapes[0], &alignment->shapes[s], 0, count, &guide, preset, energy, &improved),
           end);
    sum += energy[1];
  }
  free_landmarks(landmarks, count, &alignment->shapes[0]);
  alignment->energy = sum / (alignment->shape_count - 1);
end:
  orb_free(ctx, springs->moving);
  orb_free(ctx, springs->fixed);
  orb_free(ctx, springs->weight);
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

/* Composes the map to shape s towards a match that agrees with the landmarks, without them, and then with them pinned.
 * *energy: INFINITY if there is no such match, or no such map. */
static orb_status compose_posed(orb_context *ctx, orb_alignment *a, int32_t s, orb_preset preset, double stretch,
                                double *energy) {
  orb_aligned_shape *fixed = &a->shapes[0], *moving = &a->shapes[s];
  const orb_match_hint hint = {a->landmark_count, fixed->landmark_vertices, moving->landmark_vertices, stretch};
  const orb_map_guide near = {.from = ORB_MAP_FROM_NEAR};
  orb_match match;
  double energies[2];
  int improved;
  *energy = INFINITY;
  orb_status status = orb_match_find(ctx, &fixed->mesh, &moving->mesh, &hint, &match);
  if (status == ORB_OK && match.is_found) {
    const orb_map_guide guide = {.from = ORB_MAP_FROM_SPACE, .target = match.target};
    ORB_GO(status, orb_compose(ctx, fixed, moving, 0, 0, &guide, preset, energies, &improved), done);
    ORB_GO(status, orb_compose(ctx, fixed, moving, 0, a->landmark_count, &near, preset, energies, &improved), done);
    *energy = improved ? energies[1] : INFINITY;
  }
done:
  orb_match_free(ctx, &match);
  return status;
}

/* The alignment of shapes that are one in other poses. The map without landmarks starts on the shapes' own embeddings,
 * which pins bend: two true landmarks at the ends of a limb that is long on the sphere and short on the other one fold
 * what lies between. *found 0: the landmarks do not say so, or there is no map, and `out` is empty. */
static orb_status align_posed(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                              const orb_landmark *landmarks, int32_t landmark_count, const orb_align_options *options,
                              double stretch, orb_alignment *out, int *found) {
  orb_align_options rotated = *options;
  double sum = 0;
  rotated.method = ORB_ALIGN_ROTATE;
  *found = 0;
  ORB_TRY(create(ctx, shapes, shape_count, landmarks, landmark_count, &rotated, out));
  orb_status status = ORB_OK;
  for (int32_t s = 1; s < shape_count && sum < INFINITY && status == ORB_OK; s++) {
    double energy;
    status = compose_posed(ctx, out, s, options->preset, stretch, &energy);
    sum += energy;
  }
  *found = status == ORB_OK && sum < INFINITY;
  out->energy = sum / (shape_count - 1);
  if (!*found) {
    orb_alignment_free(ctx, out);
  }
  return status;
}

/* Improves a pinned alignment. A landmark walk is quick, and mostly as good as anything else. Where its map is not good
 * and the shapes are in other poses, a match leads to a better one. All other starts are for shapes without either. */
static orb_status improve(orb_context *ctx, const orb_align_shape *shapes, const orb_landmark *landmarks,
                          const orb_align_options *options, orb_alignment *a) {
  const double good = orb_map_params_of(options->preset).energy.good;
  const double poor = orb_map_params_of(options->preset).energy.poor;
  double energy = INFINITY;
  int walked = 0, posed = 0;
  if (a->shape_count == 2) {
    const orb_map_guide walk = {.from = ORB_MAP_FROM_WALK};
    double energies[2];
    ORB_TRY(orb_compose(ctx, &a->shapes[0], &a->shapes[1], 1, a->landmark_count, &walk, options->preset, energies,
                        &walked));
    a->energy = energy = energies[1];
  }
  if (energy > good && a->landmark_count >= ORB_FIND_HINT_LEAST) {
    orb_alignment other;
    ORB_TRY(align_posed(ctx, shapes, a->shape_count, landmarks, a->landmark_count, options,
                        energy > poor ? ORB_FIND_HINT_STRETCH_MOST : ORB_FIND_HINT_STRETCH, &other, &posed));
    if (posed && other.energy < energy) {
      orb_alignment_free(ctx, a);
      *a = other;
      energy = other.energy;
    } else if (posed) {
      orb_alignment_free(ctx, &other);
    }
  }
  if (options->preset == ORB_PRESET_QUALITY || (energy > good && !walked && !posed)) {
    return orb_compose_all(ctx, a, ORB_MAP_FROM_SPACE, NULL, options->preset);
  }
  return ORB_OK;
}

orb_status orb_align_given(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                           const orb_landmark *landmarks, int32_t landmark_count, const orb_align_options *options,
                           orb_alignment *out) {
  const int composes =
      options->preset != ORB_PRESET_FAST && (options->method == ORB_ALIGN_PIN || options->method == ORB_ALIGN_AUTO);
  orb_status status = create(ctx, shapes, shape_count, landmarks, landmark_count, options, out);
  if (status == ORB_OK && composes) {
    status = landmark_count > 0 && shape_count > 1
                 ? improve(ctx, shapes, landmarks, options, out)
                 : orb_compose_all(ctx, out, ORB_MAP_FROM_SPACE, NULL, options->preset);
  }
  if (status == ORB_OK) {
    status = soften(ctx, landmarks, options->preset, out);
  }
  if (status != ORB_OK) {
    orb_alignment_free(ctx, out);
  }
  return status;
}
