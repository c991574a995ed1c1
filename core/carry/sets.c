#include "carry/sets.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "transfer/texcoord.h"

static const float SAME = 1e-6f; /* values that differ by less are one set: rounding of a blend */

static int same_values(const float *a, const float *b, int64_t count) {
  for (int64_t i = 0; i < count; i++) {
    if (!(fabsf(a[i] - b[i]) <= SAME)) {
      return 0;
    }
  }
  return 1;
}

/* Carries one set, given at the corners of the aligned mesh. */
static orb_status carry_set(orb_context *ctx, orb_carry_source *source, orb_carry_what what, const float *values,
                            orb_wedges *out) {
  if (what == ORB_CARRY_TEXCOORD) {
    ORB_TRY(orb_carry_source_home(ctx, source));
    return orb_wedge_charts(ctx, source->supermesh, source->shape, source->number, source->home, values, out);
  }
  ORB_TRY(orb_wedge_colored(ctx, source->supermesh, source->shape, source->number, values, out));
  for (int64_t i = 0; i < 4 * (int64_t)out->value_count; i++) {
    float value = out->values[i];
    out->values[i] = value >= 0 && value <= 1 ? value : value > 1 ? 1 : 0;
  }
  return ORB_OK;
}

static orb_status carry_given(orb_context *ctx, orb_carry_source *source, orb_carry_what what, const float *own,
                              const orb_given_sets *sets, orb_wedges *out, int32_t *count) {
  int64_t corners = 3 * (int64_t)source->shape->mesh.triangle_count;
  float *values = ORB_NEW(ctx, float, sets->width *corners);
  orb_status status = values ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t i = 0; status == ORB_OK && i < sets->count; i++) {
    orb_corner_blends_apply(source->blends, corners, sets->values[i], sets->width, values);
    if (!own || !same_values(own, values, sets->width * corners)) {
      status = carry_set(ctx, source, what, values, &out[*count]);
      *count += status == ORB_OK;
    }
  }
  orb_free(ctx, values);
  return status;
}

orb_status orb_carry_sets(orb_context *ctx, orb_carry_source *source, orb_carry_what what, const float *own,
                          orb_wedges *out, int32_t *count, int *has) {
  const orb_mesh *mesh = &source->shape->mesh;
  const float *values = what == ORB_CARRY_COLOR ? mesh->colors : mesh->texcoords;
  *count = 0;
  if (!source->file->bytes) {
    *has = values != NULL;
    if (values && values != own) {
      ORB_TRY(carry_set(ctx, source, what, values, out));
      *count = 1;
    }
    return ORB_OK;
  }
  orb_given_sets sets;
  orb_given_file file = orb_carry_given(source);
  orb_status status = orb_given_sets_read(ctx, &file, what == ORB_CARRY_COLOR ? "COLOR_" : "TEXCOORD_", &sets);
  *has = sets.count > 0;
  if (status == ORB_OK) {
    status = carry_given(ctx, source, what, own, &sets, out, count);
  }
  orb_given_sets_free(ctx, &sets);
  return status;
}
