#include "align/sheet/copies.h"

#include <string.h>

#include "align/sheet/landmarks.h"
#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"

void orb_copies_free(orb_context *ctx, orb_copies *copies) {
  for (int32_t s = 0; copies->of && s < copies->shape_count; s++) {
    orb_copied_shape *one = &copies->of[s];
    orb_hierarchy_destroy(ctx, one->hierarchy);
    orb_coarse_copy_free(ctx, &one->copy);
    orb_aligned_shape_free(ctx, &one->whole);
  }
  orb_free(ctx, copies->of);
  orb_free(ctx, copies->shapes);
  orb_free(ctx, copies->landmarks);
  orb_free(ctx, copies->at);
  memset(copies, 0, sizeof *copies);
}

/* Inserts the landmarks into the whole shape as vertices. */
static orb_status insert_landmarks(orb_context *ctx, const orb_align_shape *shape, const orb_landmark *landmarks,
                                   int32_t landmark_count, int32_t s, orb_aligned_shape *out) {
  orb_sheet sheet;
  orb_status status;
  ORB_GO(status, orb_sheet_create(ctx, shape->mesh, shape->points, &sheet), end);
  ORB_GO(status, orb_sheet_insert_landmarks(ctx, &sheet, landmarks, landmark_count, s), end);
  orb_sheet_release(ctx, &sheet, out);
end:
  orb_sheet_free(ctx, &sheet);
  return status;
}

/* Puts the landmarks of shape s at their vertices of its copy. number: room for a number of each vertex. */
static orb_status place_landmarks(orb_context *ctx, orb_copies *out, int32_t s, int32_t *number) {
  const orb_copied_shape *one = &out->of[s];
  for (int32_t i = 0; i < one->copy.mesh.vertex_count; i++) {
    number[one->copy.vertex[i]] = i;
  }
  for (int32_t l = 0; l < out->landmark_count; l++) {
    ORB_TRY(orb_place_of_vertex(ctx, &one->copy.mesh, number[one->whole.landmark_vertices[l]],
                                &out->at[(size_t)l * (size_t)out->shape_count + (size_t)s]));
  }
  return ORB_OK;
}

static orb_status copy_shape(orb_context *ctx, const orb_align_shape *shape, const orb_landmark *landmarks, int32_t s,
                             int32_t size, int32_t keep_until, orb_copies *out) {
  orb_copied_shape *one = &out->of[s];
  ORB_TRY(insert_landmarks(ctx, shape, landmarks, out->landmark_count, s, &one->whole));
  const int32_t n = one->whole.mesh.vertex_count;
  unsigned char *keep = ORB_NEW0(ctx, unsigned char, n);
  int32_t *number = ORB_NEW(ctx, int32_t, n);
  orb_status status = keep && number ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto end;
  }
  for (int32_t l = 0; l < out->landmark_count; l++) {
    keep[one->whole.landmark_vertices[l]] = 1;
  }
  ORB_GO(status,
         orb_coarse_copy_level(ctx, &one->whole.mesh, keep, keep_until, size, ORB_PRESET_DEFAULT, &one->hierarchy,
                               &one->copy),
         end);
  ORB_GO(status, place_landmarks(ctx, out, s, number), end);
  out->shapes[s] = (orb_align_shape){&one->copy.mesh, one->copy.points};
end:
  orb_free(ctx, keep);
  orb_free(ctx, number);
  return status;
}

orb_status orb_copies_create(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                             const orb_landmark *landmarks, int32_t landmark_count, int32_t size, int32_t keep_until,
                             orb_copies *out) {
  const size_t count = (size_t)shape_count;
  *out = (orb_copies){.shape_count = shape_count, .landmark_count = landmark_count};
  out->of = ORB_NEW0(ctx, orb_copied_shape, shape_count);
  out->shapes = ORB_NEW(ctx, orb_align_shape, shape_count);
  out->landmarks = ORB_NEW(ctx, orb_landmark, landmark_count);
  out->at = ORB_NEW(ctx, orb_place, (size_t)landmark_count * count);
  if (!out->of || !out->shapes || !out->landmarks || !out->at) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t l = 0; l < landmark_count; l++) {
    out->landmarks[l] = landmarks[l];
    out->landmarks[l].weight = 1;
    out->landmarks[l].at = out->at + (size_t)l * count;
    out->at[(size_t)l * count] = landmarks[l].at[0];
  }
  out->shapes[0] = shapes[0];
  for (int32_t s = 1; s < shape_count; s++) {
    ORB_TRY(copy_shape(ctx, &shapes[s], landmarks, s, size, keep_until, out));
  }
  return ORB_OK;
}

orb_status orb_copies_lift_vertex(orb_context *ctx, const orb_copies *copies, int32_t shape, orb_place *place) {
  const orb_copied_shape *one = &copies->of[shape];
  if (shape == 0) {
    return ORB_OK;
  }
  for (int k = 0; k < 3; k++) {
    if (place->at[k] == 1) {
      const int32_t v = one->copy.mesh.triangles[3 * (size_t)place->triangle + (size_t)k];
      return orb_place_of_vertex(ctx, &one->whole.mesh, one->copy.vertex[v], place);
    }
  }
  return orb_fail(ctx, ORB_E_INTERNAL, "A place on a copy is not at a vertex.");
}
