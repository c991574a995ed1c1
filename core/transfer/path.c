/* In-between frames along the as-rigid-as-possible path between each two successive shapes. */
#include "transfer/path.h"

#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "transfer/arap.h"

static const float SAME = 1e-6f; /* values of one vertex that differ by less are one: the rounding of the blend */

/* One attribute between shapes a and b at t. path NULL: a linear blend. */
typedef struct between {
  const orb_draft *draft;
  const orb_arap *path;
  const orb_wedges *a, *b;
  double t;
} between;

static void blend_value(const between *job, int32_t v, int32_t value_a, int32_t value_b, float *out) {
  int32_t width = job->a->width;
  const float *a = job->a->values + (int64_t)width * value_a, *b = job->b->values + (int64_t)width * value_b;
  if (job->path) {
    orb_arap_direction(job->path, job->t, v, a, b, out);
    return;
  }
  for (int32_t c = 0; c < width; c++) {
    out[c] = (float)((1 - job->t) * (double)a[c] + job->t * (double)b[c]);
  }
}

static orb_status blend_wedges(orb_context *ctx, const between *job, orb_wedges *out) {
  const orb_supermesh *supermesh = job->draft->supermesh;
  orb_wedge_chain chain = {0};
  orb_status status = ORB_OK;
  out->width = job->a->width;
  out->value_count = supermesh->vertex_count;
  out->values = ORB_NEW(ctx, float, (int64_t)out->width * supermesh->vertex_count);
  if (!out->values) {
    return ORB_E_NO_MEMORY;
  }
  if (!job->a->of_corner && !job->b->of_corner) {
    for (int32_t v = 0; v < supermesh->vertex_count; v++) {
      blend_value(job, v, v, v, out->values + (int64_t)out->width * v);
    }
    return ORB_OK;
  }
  out->of_corner = ORB_NEW(ctx, int32_t, 3 * (int64_t)supermesh->triangle_count);
  if (!out->of_corner) {
    return ORB_E_NO_MEMORY;
  }
  ORB_GO(status, orb_wedge_chain_begin(ctx, supermesh->vertex_count, &chain), done);
  for (int64_t h = 0; h < 3 * (int64_t)supermesh->triangle_count; h++) {
    float value[4];
    int32_t v = supermesh->triangles[h];
    blend_value(job, v, orb_wedge_of(job->a, supermesh->triangles, h), orb_wedge_of(job->b, supermesh->triangles, h),
                value);
    ORB_GO(status, orb_wedges_set(ctx, out, v, h, value, SAME, &chain), done);
  }
done:
  orb_free(ctx, chain.next);
  return status;
}

static orb_status fill_gap(orb_context *ctx, orb_draft *draft, int32_t gap) {
  const orb_supermesh *supermesh = draft->supermesh;
  int32_t steps = draft->options->path_steps, pairs = draft->shape_count - 1;
  orb_arap *path = NULL;
  orb_status status = ORB_OK;
  ORB_TRY(orb_arap_create(ctx, draft->positions[gap], draft->positions[gap + 1], supermesh->vertex_count,
                          supermesh->triangles, supermesh->triangle_count, &path));
  for (int32_t k = 0; k < steps; k++) {
    int32_t f = draft->shape_count + gap * steps + k;
    between job = {.draft = draft, .path = path, .t = (double)(k + 1) / (steps + 1)};
    ORB_GO(status, orb_arap_at(ctx, path, job.t, draft->positions[f]), done);
    if (draft->normals) {
      job.a = &draft->normals[gap];
      job.b = &draft->normals[gap + 1];
      ORB_GO(status, blend_wedges(ctx, &job, &draft->normals[f]), done);
    }
    if (draft->color_count > 1) {
      job.path = NULL;
      job.a = &draft->colors[gap];
      job.b = &draft->colors[gap + 1];
      ORB_GO(status, blend_wedges(ctx, &job, &draft->colors[f]), done);
    }
    orb_progress(ctx, "write", 0.3 + 0.2 * (gap * steps + k + 1) / (pairs * steps));
  }
done:
  orb_arap_destroy(ctx, path);
  return status;
}

orb_status orb_draft_path(orb_context *ctx, orb_draft *draft) {
  for (int32_t gap = 0; draft->between_count > 0 && gap + 1 < draft->shape_count; gap++) {
    ORB_TRY(fill_gap(ctx, draft, gap));
  }
  return ORB_OK;
}
