/* The entry: checks the request, makes a working copy of each shape with the landmarks as vertices, runs the method,
 * certifies what it made, and hands the shapes over. */
#include "orbmorph/align.h"

#include <math.h>
#include <string.h>

#include "align/compose.h"
#include "align/methods.h"
#include "align/rotate.h"
#include "base/check.h"

void orb_align_defaults(orb_align_options *options) {
  memset(options, 0, sizeof *options);
  options->method = ORB_ALIGN_PIN;
  options->rbf_steps = 10;
  options->seed = 1;
}

void orb_alignment_free(orb_context *ctx, orb_alignment *alignment) {
  for (int32_t s = 0; alignment->shapes && s < alignment->shape_count; s++) {
    orb_aligned_shape *shape = &alignment->shapes[s];
    orb_mesh_free(ctx, &shape->mesh);
    orb_free(ctx, shape->parent);
    orb_free(ctx, shape->points);
    orb_free(ctx, shape->landmark_vertices);
  }
  orb_free(ctx, alignment->shapes);
  orb_free(ctx, alignment->found);
  orb_free(ctx, alignment->confidence);
  orb_free(ctx, alignment->found_points);
  memset(alignment, 0, sizeof *alignment);
}

static orb_status check_request(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                int32_t landmark_count, const orb_align_options *options) {
  if (shape_count < 1 || landmark_count < 0) {
    return orb_fail(ctx, ORB_E_BAD_OPTION, "At least one shape must be given.");
  }
  if ((options->method == ORB_ALIGN_PIN || options->method == ORB_ALIGN_RBF) && landmark_count == 0) {
    return orb_fail(ctx, ORB_E_BAD_OPTION,
                    "This alignment needs landmarks; give some, or use the method rotate or auto.");
  }
  if (options->method < ORB_ALIGN_PIN || options->method > ORB_ALIGN_AUTO || options->rbf_steps < 1 ||
      options->rbf_steps > 10000 || !(options->rbf_radius >= 0) || !(options->max_growth >= 0)) {
    return orb_fail(ctx, ORB_E_BAD_OPTION,
                    "An alignment option is out of range: 1 to 10000 steps, radius ≥ 0, growth ≥ 0.");
  }
  for (int32_t s = 0; s < shape_count; s++) {
    if (!shapes[s].mesh || !shapes[s].points || shapes[s].mesh->triangle_count < 4) {
      return orb_fail(ctx, ORB_E_BAD_OPTION, "Shape %d has no embedding.", s);
    }
  }
  return ORB_OK;
}

/* On how many shapes landmarks i and j share a vertex; where: the last such shape. */
static int32_t shared(const orb_sheet *sheets, int32_t shape_count, int32_t i, int32_t j, int32_t *where) {
  int32_t same = 0;
  for (int32_t s = 0; s < shape_count; s++) {
    const int32_t *v = sheets[s].shape.landmark_vertices;
    if (v[i] == v[j]) {
      same++;
      *where = s;
    }
  }
  return same;
}

/* Landmarks i and j share a vertex on `shape` but not on every shape: names them and all others of which that holds. */
static orb_status contradiction(orb_context *ctx, const orb_sheet *sheets, int32_t shape_count, int32_t landmark_count,
                                int32_t i, int32_t j, int32_t shape) {
  orb_status status = orb_fail(ctx, ORB_E_BAD_LANDMARKS,
                               "Landmarks %d and %d are at one place on shape %d but not on every shape: move or drop "
                               "one of them.",
                               i, j, shape);
  orb_error *error = orb_context_error_edit(ctx);
  error->shape = shape;
  for (int32_t a = 0; a < landmark_count && error->landmark_count < ORB_ERROR_ITEMS; a++) {
    for (int32_t b = 0; b < landmark_count; b++) {
      int32_t where, same = a == b ? 0 : shared(sheets, shape_count, a, b, &where);
      if (same > 0 && same < shape_count) {
        error->landmarks[error->landmark_count++] = a;
        break;
      }
    }
  }
  return status;
}

orb_status orb_landmarks_distinct(orb_context *ctx, const orb_sheet *sheets, int32_t shape_count,
                                  int32_t landmark_count, int32_t *unique, int32_t *unique_count) {
  int32_t found = 0;
  for (int32_t j = 0; j < landmark_count; j++) {
    int32_t twin_of = -1, where = 0;
    for (int32_t i = 0; i < j; i++) {
      int32_t same = shared(sheets, shape_count, i, j, &where);
      if (same == shape_count) {
        twin_of = i;
      } else if (same > 0) {
        return contradiction(ctx, sheets, shape_count, landmark_count, i, j, where);
      }
    }
    if (twin_of < 0) {
      unique[found++] = j;
    }
  }
  *unique_count = found;
  return ORB_OK;
}

static orb_status rotate_by_search(orb_context *ctx, orb_sheet *sheets, int32_t shape_count) {
  for (int32_t s = 1; s < shape_count; s++) {
    double rotation[9];
    ORB_TRY(orb_rotation_search(ctx, &sheets[0].shape, &sheets[s].shape, rotation, NULL));
    ORB_TRY(orb_sheet_rotate(ctx, &sheets[s], rotation));
    orb_progress(ctx, "align", (double)s / shape_count);
  }
  return ORB_OK;
}

orb_status orb_landmark_points(orb_context *ctx, const orb_sheet *sheets, int32_t shape_count, const int32_t *landmarks,
                               int32_t count, double **out) {
  double *points = ORB_NEW(ctx, double, 3 * (size_t)shape_count * (size_t)count);
  if (!points) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t s = 0; s < shape_count; s++) {
    for (int32_t k = 0; k < count; k++) {
      int32_t v = sheets[s].shape.landmark_vertices[landmarks[k]];
      memcpy(points + 3 * ((size_t)s * (size_t)count + (size_t)k), sheets[s].shape.points + 3 * (size_t)v,
             3 * sizeof *points);
    }
  }
  *out = points;
  return ORB_OK;
}

orb_status orb_rotate_by_landmarks(orb_context *ctx, orb_sheet *sheets, int32_t shape_count, const int32_t *landmarks,
                                   int32_t count) {
  orb_status status = ORB_OK;
  double *points = NULL, *rotations = ORB_NEW(ctx, double, 9 * (size_t)shape_count),
         *means = ORB_NEW(ctx, double, 3 * (size_t)count);
  const orb_aligned_shape **shapes = ORB_NEW(ctx, const orb_aligned_shape *, shape_count);
  if (!rotations || !means || !shapes) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  ORB_GO(status, orb_landmark_points(ctx, sheets, shape_count, landmarks, count, &points), end);
  for (int32_t s = 0; s < shape_count; s++) {
    shapes[s] = &sheets[s].shape;
  }
  ORB_GO(status, orb_rotations_find(ctx, shapes, points, shape_count, count, rotations, means), end);
  for (int32_t s = 0; s < shape_count; s++) {
    ORB_GO(status, orb_sheet_rotate(ctx, &sheets[s], rotations + 9 * (size_t)s), end);
  }
end:
  orb_free(ctx, points);
  orb_free(ctx, rotations);
  orb_free(ctx, means);
  orb_free(ctx, shapes);
  return status;
}

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
    status = rotate_by_search(ctx, sheets, shape_count);
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

/* Aligned landmarks are not yet a good morph: the maps from the first shape's surface to the others' are improved. */
orb_status orb_compose_all(orb_context *ctx, orb_alignment *alignment, cm_from from, orb_preset preset) {
  double sum = 0;
  for (int32_t s = 1; s < alignment->shape_count; s++) {
    double energy[2];
    int improved;
    int both = alignment->shape_count == 2 && alignment->landmark_count > 0;
    ORB_TRY(orb_compose(ctx, &alignment->shapes[0], &alignment->shapes[s], both, alignment->landmark_count, from,
                        preset, energy, &improved));
    sum += energy[1];
  }
  alignment->energy = sum / (alignment->shape_count - 1);
  return ORB_OK;
}

orb_status orb_align_given(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
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
  if (options->preset != ORB_PRESET_FAST && (options->method == ORB_ALIGN_PIN || options->method == ORB_ALIGN_AUTO)) {
    ORB_GO(status, orb_compose_all(ctx, out, CM_FROM_SPACE, options->preset), end);
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

orb_status orb_align(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                     const orb_landmark *landmarks, int32_t landmark_count, const orb_align_options *options,
                     orb_alignment *out) {
  memset(out, 0, sizeof *out);
  ORB_TRY(check_request(ctx, shapes, shape_count, landmark_count, options));
  const char *before = orb_progress_only(ctx, "align"); /* shapes are embedded anew on the way */
  orb_status status;
  if (options->method == ORB_ALIGN_AUTO && landmark_count == 0 && shape_count > 1) {
    status = orb_align_auto(ctx, shapes, shape_count, options, out);
  } else {
    status = orb_align_given(ctx, shapes, shape_count, landmarks, landmark_count, options, out);
  }
  if (status == ORB_OK) {
    orb_progress(ctx, "align", 1);
  }
  (void)orb_progress_only(ctx, before);
  return status;
}
