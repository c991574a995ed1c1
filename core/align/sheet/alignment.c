#include "orbmorph/alignment.h"

#include <string.h>

#include "align/sheet/sheet.h"
#include "base/error.h"
#include "base/memory.h"

void orb_alignment_free(orb_context *ctx, orb_alignment *alignment) {
  for (int32_t s = 0; alignment->shapes && s < alignment->shape_count; s++) {
    orb_aligned_shape_free(ctx, &alignment->shapes[s]);
  }
  orb_free(ctx, alignment->shapes);
  orb_free(ctx, alignment->found);
  orb_free(ctx, alignment->confidence);
  orb_free(ctx, alignment->found_points);
  for (int32_t i = 0; alignment->alternatives && i < alignment->alternative_count; i++) {
    orb_free(ctx, alignment->alternatives[i].at);
  }
  orb_free(ctx, alignment->alternatives);
  orb_free(ctx, alignment->suspects);
  orb_free(ctx, alignment->landmark_shares);
  orb_free(ctx, alignment->rims);
  memset(alignment, 0, sizeof *alignment);
}

int orb_alignment_lacks_room(orb_context *ctx, orb_status status) {
  if (status != ORB_E_BAD_LANDMARKS && status != ORB_E_NOT_CERTIFIED) {
    return 0;
  }
  orb_error_clear(ctx);
  return 1;
}

void orb_alignment_keep_better(orb_context *ctx, orb_alignment *one, orb_alignment *other) {
  const int better = other->energy < one->energy;
  orb_alignment_free(ctx, better ? one : other);
  if (better) {
    *one = *other;
  }
  memset(other, 0, sizeof *other);
}

void orb_alignment_swap(orb_alignment *alignment) {
  const orb_aligned_shape first = alignment->shapes[0];
  alignment->shapes[0] = alignment->shapes[1];
  alignment->shapes[1] = first;
  for (int32_t i = 0; i < alignment->alternative_count; i++) {
    for (int32_t k = 0; k < alignment->alternatives[i].count; k++) {
      orb_place *at = alignment->alternatives[i].at + 2 * (size_t)k, place = at[0];
      at[0] = at[1];
      at[1] = place;
    }
  }
}

void orb_alignment_forget_landmarks(orb_context *ctx, int32_t kept, orb_alignment *alignment) {
  alignment->landmark_count = kept;
  for (int32_t s = 0; s < alignment->shape_count && kept == 0; s++) {
    orb_free(ctx, alignment->shapes[s].landmark_vertices);
    alignment->shapes[s].landmark_vertices = NULL;
  }
}
