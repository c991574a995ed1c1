/* Alignments in which pairs of vertices that a match has found are held like landmarks. */
#include <string.h>

#include "align/methods.h"
#include "align/sheet/sheet.h"
#include "base/check.h"
#include "base/memory.h"

/* Has no mesh been split? */
static int is_unsplit(const orb_align_shape *shapes, const orb_alignment *a) {
  for (int32_t s = 0; s < a->shape_count; s++) {
    if (a->shapes[s].mesh.vertex_count != shapes[s].mesh->vertex_count) {
      return 0;
    }
  }
  return 1;
}

/* at: room for a place a pair and shape. */
static orb_status write_landmarks(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                  const orb_held_pairs *pairs, orb_place *at, orb_landmark *out) {
  for (size_t k = 0; k < (size_t)pairs->count; k++) {
    out[k].at = at + k * (size_t)shape_count;
    for (size_t s = 0; s < (size_t)shape_count; s++) {
      ORB_TRY(orb_place_of_vertex(ctx, shapes[s].mesh, pairs->vertex[s * (size_t)pairs->stride + k],
                                  &at[k * (size_t)shape_count + s]));
    }
  }
  return ORB_OK;
}

orb_status orb_align_held(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                          const orb_held_pairs *pairs, int for_good, const orb_align_options *options,
                          orb_alignment *out, int *held) {
  orb_status status = ORB_E_NO_MEMORY;
  orb_align_options pin = *options;
  orb_place *at = ORB_NEW(ctx, orb_place, (size_t)pairs->count * (size_t)shape_count);
  orb_landmark *landmarks = ORB_NEW0(ctx, orb_landmark, pairs->count);
  pin.method = ORB_ALIGN_PIN;
  pin.max_growth = 1e-9; /* practically none: 0 would mean the default */
  memset(out, 0, sizeof *out);
  *held = 0;
  if (!at || !landmarks) {
    goto end;
  }
  ORB_GO(status, write_landmarks(ctx, shapes, shape_count, pairs, at, landmarks), end);
  status = for_good ? orb_align_by_landmarks(ctx, shapes, shape_count, landmarks, pairs->count, &pin, out)
                    : orb_align_pinned(ctx, shapes, shape_count, landmarks, pairs->count, &pin, out);
  if (orb_alignment_lacks_room(ctx, status)) {
    status = ORB_OK;
    goto end;
  }
  if (status != ORB_OK || !is_unsplit(shapes, out)) {
    goto end;
  }
  if (!for_good) {
    orb_alignment_forget_landmarks(ctx, 0, out);
    ORB_GO(status, orb_compose_all(ctx, out, ORB_MAP_FROM_MAP, NULL, options->preset), end);
  }
  *held = 1;
end:
  orb_free(ctx, at);
  orb_free(ctx, landmarks);
  if (!*held) {
    orb_alignment_free(ctx, out);
  }
  return status;
}
