#include "carry/carry.h"

#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "carry/check.h"
#include "carry/sets.h"
#include "carry/targets.h"
#include "carry/texels.h"

static orb_status open_sets(orb_context *ctx, orb_carrier *out, int32_t number, orb_carry_source *source, int *has) {
  const orb_carry *carry = &out->job.carries[number];
  const orb_mesh *mesh = &source->shape->mesh;
  const float *own = carry->from > 0 ? NULL : carry->what == ORB_CARRY_COLOR ? mesh->colors : mesh->texcoords;
  orb_wedges made[ORB_GIVEN_SETS] = {{0}};
  int32_t count = 0;
  orb_status status = orb_carry_sets(ctx, source, carry->what, own, made, &count, has);
  for (int32_t i = 0; i < count; i++) {
    out->sets[out->set_count++] = (orb_carried_set){number, made[i]};
  }
  return status;
}

static orb_status open_targets(orb_context *ctx, orb_carrier *out, int32_t number, const orb_carry_source *source,
                               int *has) {
  orb_asset_target *made;
  int32_t count, all = out->target_count;
  orb_status status = orb_carry_targets(ctx, source, out->moved + 16 * (int64_t)source->number, &made, &count);
  *has = count > 0;
  if (status == ORB_OK && count > 0) {
    orb_asset_target *targets = orb_realloc(ctx, out->targets, (size_t)(all + count), sizeof *targets);
    out->targets = targets ? targets : out->targets;
    int32_t *carries = orb_realloc(ctx, out->target_carry, (size_t)(all + count), sizeof *carries);
    out->target_carry = carries ? carries : out->target_carry;
    status = targets && carries ? ORB_OK : ORB_E_NO_MEMORY;
  }
  for (int32_t k = 0; status == ORB_OK && k < count; k++) {
    out->targets[out->target_count] = made[k];
    out->target_carry[out->target_count++] = number;
    made[k].moves = NULL; /* moved */
  }
  orb_carried_targets_free(ctx, made, count);
  return status;
}

static orb_status open_one(orb_context *ctx, orb_carrier *out, int32_t number) {
  const orb_carry_job *job = &out->job;
  const orb_carry *carry = &job->carries[number];
  orb_carry_source source = {.number = carry->from,
                             .supermesh = job->supermesh,
                             .shape = &job->shapes[carry->from],
                             .given = job->given[carry->from].mesh,
                             .file = &job->files[carry->from]};
  int has = 0;
  orb_status status = orb_carry_source_open(ctx, &source);
  if (status == ORB_OK && carry->what == ORB_CARRY_SKIN) {
    status = orb_carry_skin(ctx, &source, &out->skin);
    has = out->skin.given.skin >= 0;
    out->skin_carry = number;
  } else if (status == ORB_OK && carry->what == ORB_CARRY_TARGETS) {
    status = open_targets(ctx, out, number, &source, &has);
  } else if (status == ORB_OK && carry->what == ORB_CARRY_TEXTURE) {
    has = orb_texels_has(&source.shape->mesh);
    out->texture_count++;
  } else if (status == ORB_OK) {
    status = open_sets(ctx, out, number, &source, &has);
  }
  orb_carry_source_close(ctx, &source);
  return status == ORB_OK && !has ? orb_carry_refuse(ctx, job->carries, number)
                                  : orb_carry_blame(ctx, status, carry->from, number);
}

static orb_status allocate(orb_context *ctx, orb_carrier *out) {
  const orb_carry_job *job = &out->job;
  out->set_capacity = ORB_GIVEN_SETS * job->carry_count;
  out->sets = ORB_NEW0(ctx, orb_carried_set, out->set_capacity);
  out->splits = ORB_NEW0(ctx, const int32_t *, out->set_capacity);
  out->moved = ORB_NEW(ctx, double, 16 * (int64_t)job->supermesh->shape_count);
  return out->sets && out->splits && out->moved ? ORB_OK : ORB_E_NO_MEMORY;
}

orb_status orb_carrier_open(orb_context *ctx, const orb_carry_job *job, orb_carrier *out) {
  *out = (orb_carrier){.job = *job, .skin_carry = -1};
  if (job->carry_count == 0) {
    return ORB_OK;
  }
  ORB_TRY(orb_carry_entries(ctx, job->carries, job->carry_count, job->supermesh->shape_count));
  ORB_TRY(allocate(ctx, out));
  ORB_TRY(orb_asset_transforms(ctx, job->supermesh, job->shapes, job->fit, out->moved, NULL));
  for (int32_t i = 0; i < job->carry_count; i++) {
    if (!(job->is_document && job->carries[i].from == 0)) { /* its document has it */
      ORB_TRY(open_one(ctx, out, i));
    }
  }
  for (int32_t i = 0; i < out->set_count; i++) {
    out->splits[i] = out->sets[i].wedges.of_corner;
  }
  return ORB_OK;
}

void orb_carrier_free(orb_context *ctx, orb_carrier *carrier) {
  for (int32_t i = 0; i < carrier->set_count; i++) {
    orb_wedges_free(ctx, &carrier->sets[i].wedges);
  }
  orb_free(ctx, carrier->sets);
  orb_free(ctx, carrier->splits);
  orb_free(ctx, carrier->moved);
  orb_carried_skin_free(ctx, &carrier->skin);
  orb_carried_targets_free(ctx, carrier->targets, carrier->target_count);
  orb_free(ctx, carrier->target_carry);
  memset(carrier, 0, sizeof *carrier);
}
