#include "carry/targets.h"

#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"

static orb_status carry_target(orb_context *ctx, const orb_carry_source *source, const double moved[16],
                               const float *moves, float **out) {
  int32_t count = source->supermesh->vertex_count;
  float *made = *out = ORB_NEW(ctx, float, 3 * (int64_t)count);
  if (!made) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t v = 0; v < count; v++) {
    orb_blend from;
    double sum[3] = {0};
    orb_carry_blend(source, v, &from);
    for (int32_t b = 0; b < from.count; b++) {
      for (int c = 0; c < 3; c++) {
        sum[c] += from.weight[b] * (double)moves[3 * (int64_t)from.vertex[b] + c];
      }
    }
    for (int r = 0; r < 3; r++) {
      made[3 * (int64_t)v + r] = (float)(moved[r] * sum[0] + moved[4 + r] * sum[1] + moved[8 + r] * sum[2]);
    }
  }
  return orb_context_check(ctx);
}

orb_status orb_carry_targets(orb_context *ctx, const orb_carry_source *source, const double moved[16],
                             orb_asset_target **out, int32_t *count) {
  orb_given_targets given = {0};
  orb_status status = ORB_OK;
  *out = NULL;
  *count = 0;
  if (source->file->bytes) {
    orb_given_file file = orb_carry_given(source);
    status = orb_given_targets_read(ctx, &file, &given);
  }
  if (status == ORB_OK && given.count > 0) {
    *out = ORB_NEW0(ctx, orb_asset_target, given.count);
    status = *out ? ORB_OK : ORB_E_NO_MEMORY;
  }
  for (int32_t k = 0; status == ORB_OK && k < given.count; k++) {
    orb_asset_target *target = &(*out)[(*count)++];
    memcpy(target->name, given.names[k], sizeof target->name);
    status = carry_target(ctx, source, moved, given.moves[k], &target->moves);
  }
  orb_given_targets_free(ctx, &given);
  return status;
}

void orb_carried_targets_free(orb_context *ctx, orb_asset_target *targets, int32_t count) {
  for (int32_t k = 0; k < count; k++) {
    orb_free(ctx, targets[k].moves);
  }
  orb_free(ctx, targets);
}
