#include "transfer/targets.h"

#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "numeric/rotate_along.h"

/* A copy, with the seams of the original. */
static orb_status copy_wedges(orb_context *ctx, const orb_supermesh *supermesh, const orb_wedges *from,
                              orb_wedges *out) {
  size_t values = (size_t)from->width * (size_t)from->value_count, corners = 3 * (size_t)supermesh->triangle_count;
  *out = (orb_wedges){.width = from->width, .value_count = from->value_count};
  out->values = ORB_NEW(ctx, float, values);
  out->of_corner = from->of_corner ? ORB_NEW(ctx, int32_t, corners) : NULL;
  if (!out->values || (from->of_corner && !out->of_corner)) {
    return ORB_E_NO_MEMORY;
  }
  memcpy(out->values, from->values, values * sizeof *out->values);
  if (from->of_corner) {
    memcpy(out->of_corner, from->of_corner, corners * sizeof *out->of_corner);
  }
  return ORB_OK;
}

static void rotate_normal(const double before[3], const double after[3], float normal[3]) {
  double n[3] = {(double)normal[0], (double)normal[1], (double)normal[2]}, rotated[3];
  if (memcmp(before, after, 3 * sizeof *before) == 0 || !(orb_dot(before, before) > 0 && orb_dot(after, after) > 0)) {
    return;
  }
  orb_rotate_along(before, after, n, rotated);
  orb_normalize(rotated);
  for (int c = 0; c < 3; c++) {
    normal[c] = (float)rotated[c];
  }
}

/* before: the smooth normals of the first frame. scratch: room for as many. */
static orb_status rotate_normals(orb_context *ctx, const orb_draft *draft, int32_t f, const double *before,
                                 double *scratch) {
  const orb_supermesh *mesh = draft->supermesh;
  orb_wedges *normals = &draft->normals[f];
  ORB_TRY(copy_wedges(ctx, mesh, &draft->normals[0], normals));
  ORB_TRY(
      orb_smooth_normals(ctx, draft->positions[f], mesh->vertex_count, mesh->triangles, mesh->triangle_count, scratch));
  for (int64_t v = 0; v < mesh->vertex_count; v++) {
    rotate_normal(before + 3 * v, scratch + 3 * v, normals->values + 3 * v);
  }
  unsigned char *done = ORB_NEW0(ctx, unsigned char, normals->value_count);
  if (!done) {
    return ORB_E_NO_MEMORY;
  }
  for (int64_t h = 0; normals->of_corner && h < 3 * (int64_t)mesh->triangle_count; h++) {
    int64_t at = normals->of_corner[h], v = mesh->triangles[h];
    if (at >= mesh->vertex_count && !done[at]) { /* the first ones are those of the vertices */
      rotate_normal(before + 3 * v, scratch + 3 * v, normals->values + 3 * at);
      done[at] = 1;
    }
  }
  orb_free(ctx, done);
  return orb_context_check(ctx);
}

orb_status orb_draft_targets(orb_context *ctx, orb_draft *draft) {
  const orb_supermesh *mesh = draft->supermesh;
  const orb_asset_options *options = draft->options;
  int64_t size = 3 * (int64_t)mesh->vertex_count;
  if (options->target_count == 0) {
    return ORB_OK;
  }
  double *before = draft->normals ? ORB_NEW(ctx, double, size) : NULL;
  double *scratch = draft->normals ? ORB_NEW(ctx, double, size) : NULL;
  orb_status status = !draft->normals || (before && scratch) ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK && draft->normals) {
    status =
        orb_smooth_normals(ctx, draft->positions[0], mesh->vertex_count, mesh->triangles, mesh->triangle_count, before);
  }
  for (int32_t k = 0; status == ORB_OK && k < options->target_count; k++) {
    int32_t f = draft->shape_count + draft->between_count + k;
    for (int64_t i = 0; i < size; i++) {
      draft->positions[f][i] = draft->positions[0][i] + (double)options->targets[k].moves[i];
    }
    if (draft->normals) {
      ORB_GO(status, rotate_normals(ctx, draft, f, before, scratch), done);
    }
    if (draft->color_count > 1) {
      ORB_GO(status, copy_wedges(ctx, mesh, &draft->colors[0], &draft->colors[f]), done);
    }
  }
done:
  orb_free(ctx, before);
  orb_free(ctx, scratch);
  return status;
}
