/* One method: each shape gets a working copy with the landmarks as vertices, the method runs, and the result is
 * certified. Then the maps can be composed. */
#include <math.h>
#include <string.h>

#include "align/find/params.h"
#include "align/map/engine/params.h"
#include "align/methods.h"
#include "align/pin/pin.h"
#include "align/rbf/rbf.h"
#include "align/rotate/rotate.h"
#include "align/sheet/landmarks.h"
#include "align/sheet/sheet.h"
#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "base/tasks.h"

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
      orb_status status = orb_fail(ctx, ORB_E_NOT_CERTIFIED, "The alignment of a shape is not certified.");
      orb_context_error_edit(ctx)->shape = s;
      return status;
    }
  }
  return ORB_OK;
}

orb_status orb_align_by_method(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
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

orb_status orb_align_each(orb_context *ctx, const orb_aligned_shape *first, orb_preset preset, int32_t count,
                          orb_task_fn task, void *arg) {
  if (first->mesh.vertex_count <= orb_map_params_of(preset).copies.large) {
    return orb_tasks_run(ctx, count, task, arg);
  }
  for (int32_t i = 0; i < count; i++) {
    ORB_TRY(task(ctx, arg, i));
  }
  return ORB_OK;
}

/* The maps of several shapes to the first one. Each changes its own shape only, unless there are two shapes. */
typedef struct composing {
  orb_alignment *alignment;
  orb_map_from from;
  const orb_aims *aims;
  orb_preset preset;
  double *energy; /* of each map */
} composing;

static orb_status compose_one(orb_context *ctx, void *arg, int32_t i) {
  const composing *all = arg;
  const orb_aims *aims = all->aims;
  orb_alignment *alignment = all->alignment;
  const int32_t s = i + 1;
  const orb_map_guide guide = {.from = all->from,
                               .fits_parts = alignment->landmark_count > 0,
                               .target = aims->targets ? aims->targets[s] : NULL,
                               .aim = aims->aim,
                               .keeps_angles = aims->keep_angles,
                               .beat = aims->beat,
                               .course = aims->course,
                               .walks_first = aims->walks_first,
                               .walks_early = aims->walks_early};
  const int both = alignment->shape_count == 2 && (alignment->landmark_count > 0 || aims->targets);
  double energy[2];
  int improved;
  ORB_TRY(orb_compose(ctx, &alignment->shapes[0], &alignment->shapes[s], both, alignment->landmark_count, &guide,
                      all->preset, energy, &improved));
  all->energy[i] = energy[1];
  return ORB_OK;
}

orb_status orb_compose_all(orb_context *ctx, orb_alignment *alignment, orb_map_from from, const orb_aims *aims,
                           orb_preset preset) {
  const orb_aims none = {0};
  const int32_t count = alignment->shape_count - 1;
  composing all = {alignment, from, aims ? aims : &none, preset, ORB_NEW(ctx, double, count)};
  orb_status status =
      all.energy ? orb_align_each(ctx, &alignment->shapes[0], preset, count, compose_one, &all) : ORB_E_NO_MEMORY;
  double sum = 0;
  for (int32_t i = 0; i < count && status == ORB_OK; i++) {
    sum += all.energy[i];
  }
  alignment->energy = status == ORB_OK ? sum / count : alignment->energy;
  orb_free(ctx, all.energy);
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
