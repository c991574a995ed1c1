/* Alignment by one method: each shape gets a working copy with the landmarks as vertices, the method runs, the result
 * is certified, and the composed map is improved. Soft landmarks are released at the end. If copies of large shapes
 * were aligned, the shapes then follow their copies. */
#include <math.h>
#include <string.h>

#include "align/find/params.h"
#include "align/methods.h"
#include "align/sheet/landmarks.h"
#include "align/sheet/sheet.h"
#include "base/check.h"
#include "base/memory.h"

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
    if (orb_landmark_is_soft(&landmarks[l])) {
      out->fixed[out->count] = fixed[l];
      out->moving[out->count] = moving[l];
      out->weight[out->count++] = landmarks[l].weight / (1 - landmarks[l].weight);
    }
  }
}

/* Makes the soft landmarks of a shape ordinary vertices, which no other shape shares. */
static void free_landmarks(const orb_landmark *landmarks, int32_t count, orb_aligned_shape *shape) {
  for (int32_t l = 0; l < count; l++) {
    if (orb_landmark_is_soft(&landmarks[l])) {
      shape->landmark_vertices[l] = -1;
    }
  }
}

orb_status orb_align_soften(orb_context *ctx, const orb_landmark *landmarks, int32_t count, orb_preset preset,
                            orb_alignment *alignment) {
  const int32_t soft = orb_landmarks_soft(landmarks, count);
  if (soft == 0 || alignment->shape_count < 2) {
    return ORB_OK;
  }
  orb_map_guide guide = {.from = ORB_MAP_FROM_PINS, .fits_parts = 1};
  orb_status status = springs_create(ctx, soft, &guide.springs);
  double sum = 0;
  for (int32_t s = 1; s < alignment->shape_count && status == ORB_OK; s++) {
    double energy[2];
    int improved;
    set_springs(landmarks, count, alignment->shapes[0].landmark_vertices, alignment->shapes[s].landmark_vertices,
                &guide.springs);
    free_landmarks(landmarks, count, &alignment->shapes[s]);
    ORB_GO(status,
           orb_compose(ctx, &alignment->shapes[0], &alignment->shapes[s], 0, alignment->landmark_count, &guide, preset,
                       energy, &improved),
           end);
    sum += energy[1];
  }
  free_landmarks(landmarks, count, &alignment->shapes[0]);
  alignment->energy = sum / (alignment->shape_count - 1);
end:
  springs_free(ctx, &guide.springs);
  return status;
}

/* Aligns by the method, then composes the maps. quick: first tries what leads to a good map soonest. */
static orb_status align_and_compose(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                    const orb_landmark *landmarks, int32_t landmark_count,
                                    const orb_align_options *options, int quick, orb_alignment *out) {
  const int composes = orb_align_composes(options);
  orb_status status;
  if (composes && quick && landmark_count > 0 && shape_count > 1) {
    status = orb_align_by_landmarks(ctx, shapes, shape_count, landmarks, landmark_count, options, out);
  } else {
    status = orb_align_by_method(ctx, shapes, shape_count, landmarks, landmark_count, options, out);
    if (status == ORB_OK && composes) {
      status = orb_compose_all(ctx, out, ORB_MAP_FROM_SPACE, NULL, options->preset);
    }
  }
  if (status == ORB_OK) {
    status = orb_align_soften(ctx, landmarks, landmark_count, options->preset, out);
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
static orb_status lift_shape(orb_context *ctx, orb_copied_shape *copied, const orb_landmark *landmarks, int32_t count,
                             int32_t s, orb_preset preset, orb_alignment *alignment, double *energy) {
  orb_aligned_shape *fixed = &alignment->shapes[0], *whole = &copied->whole;
  orb_map_guide guide = {.from = ORB_MAP_FROM_COPY,
                         .fits_parts = 1,
                         .copy = {copied->copy.mesh.vertex_count, copied->copy.vertex, alignment->shapes[s].points,
                                  &copied->hierarchy, orb_landmarks_soft(landmarks, count) > 0}};
  double energies[2];
  int improved = 0;
  orb_status status;
  ORB_GO(status, springs_create(ctx, orb_landmarks_soft(landmarks, count), &guide.springs), end);
  set_springs(landmarks, count, fixed->landmark_vertices, whole->landmark_vertices, &guide.springs);
  free_landmarks(landmarks, count, whole);
  ORB_GO(status, orb_compose(ctx, fixed, whole, 0, alignment->landmark_count, &guide, preset, energies, &improved),
         end);
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

/* What is held for a part, after the `count` given landmarks, is at vertices of the copies. Holds it at the same
 * vertices of the whole shapes, which have the given ones. */
static orb_status lift_held(orb_context *ctx, orb_copies *copies, int32_t count, const orb_alignment *alignment) {
  for (int32_t s = 1; s < alignment->shape_count; s++) {
    orb_copied_shape *one = &copies->of[s];
    int32_t *vertex = ORB_NEW(ctx, int32_t, alignment->landmark_count);
    if (!vertex) {
      return ORB_E_NO_MEMORY;
    }
    for (int32_t l = 0; l < alignment->landmark_count; l++) {
      vertex[l] =
          l < count ? one->whole.landmark_vertices[l] : one->copy.vertex[alignment->shapes[s].landmark_vertices[l]];
    }
    orb_free(ctx, one->whole.landmark_vertices);
    one->whole.landmark_vertices = vertex;
  }
  return ORB_OK;
}

orb_status orb_align_lift(orb_context *ctx, orb_copies *copies, const orb_landmark *landmarks, int32_t landmark_count,
                          orb_preset preset, orb_alignment *alignment, int *lifted) {
  double sum = 0;
  orb_status status;
  *lifted = 0;
  ORB_GO(status, lift_alternatives(ctx, copies, alignment), end);
  if (alignment->landmark_count > landmark_count) {
    ORB_GO(status, lift_held(ctx, copies, landmark_count, alignment), end);
  }
  for (int32_t s = 1; s < alignment->shape_count && sum < INFINITY; s++) {
    double energy = INFINITY;
    ORB_GO(status, lift_shape(ctx, &copies->of[s], landmarks, landmark_count, s, preset, alignment, &energy), end);
    sum += energy;
  }
  free_landmarks(landmarks, landmark_count, &alignment->shapes[0]);
  alignment->energy = sum / (alignment->shape_count - 1);
  *lifted = sum < INFINITY;
end:
  if (!*lifted) {
    orb_alignment_free(ctx, alignment);
  }
  return status;
}
