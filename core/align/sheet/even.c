#include "align/sheet/even.h"

#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "embed/newton/newton.h"
#include "orbmorph/embed.h"

/* Embeds a mesh. *valid 0: the sphere is not certified. */
static orb_status embed(orb_context *ctx, const orb_mesh *mesh, double *points, int *valid) {
  orb_embed_options options;
  orb_certificate certificate;
  orb_embed_defaults(&options);
  *valid = 0;
  orb_status status = orb_newton_run_angles(ctx, mesh, &options, points);
  if (status == ORB_E_NOT_CERTIFIED) { /* a vertex had no room */
    orb_error_clear(ctx);
    return ORB_OK;
  }
  ORB_TRY(status);
  ORB_TRY(orb_certify(ctx, points, mesh->vertex_count, mesh->triangles, mesh->triangle_count, &certificate));
  *valid = certificate.valid;
  return ORB_OK;
}

orb_status orb_even_shapes_create(orb_context *ctx, const orb_align_shape *shapes, int32_t count,
                                  orb_even_shapes *out) {
  *out = (orb_even_shapes){ORB_NEW(ctx, orb_align_shape, count), ORB_NEW0(ctx, double *, count), count};
  if (!out->shapes || !out->points) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t s = 0; s < count; s++) {
    int valid;
    out->shapes[s] = shapes[s];
    out->points[s] = ORB_NEW(ctx, double, 3 * (size_t)shapes[s].mesh->vertex_count);
    if (!out->points[s]) {
      return ORB_E_NO_MEMORY;
    }
    ORB_TRY(embed(ctx, shapes[s].mesh, out->points[s], &valid));
    if (valid) {
      out->shapes[s].points = out->points[s];
    }
  }
  return ORB_OK;
}

void orb_even_shapes_free(orb_context *ctx, orb_even_shapes *even) {
  for (int32_t s = 0; even->points && s < even->count; s++) {
    orb_free(ctx, even->points[s]);
  }
  orb_free(ctx, even->points);
  orb_free(ctx, even->shapes);
  memset(even, 0, sizeof *even);
}
