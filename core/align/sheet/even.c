#include "align/sheet/even.h"

#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "embed/newton/newton.h"
#include "orbmorph/embed.h"

orb_status orb_even_shapes_create(orb_context *ctx, const orb_align_shape *shapes, int32_t count,
                                  orb_even_shapes *out) {
  orb_embed_options options;
  orb_embed_defaults(&options);
  *out = (orb_even_shapes){ORB_NEW(ctx, orb_align_shape, count), ORB_NEW0(ctx, double *, count), count};
  if (!out->shapes || !out->points) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t s = 0; s < count; s++) {
    const orb_mesh *mesh = shapes[s].mesh;
    orb_certificate certificate;
    out->shapes[s] = shapes[s];
    out->points[s] = ORB_NEW(ctx, double, 3 * (size_t)mesh->vertex_count);
    if (!out->points[s]) {
      return ORB_E_NO_MEMORY;
    }
    ORB_TRY(orb_newton_run_angles(ctx, mesh, &options, out->points[s]));
    ORB_TRY(orb_certify(ctx, out->points[s], mesh->vertex_count, mesh->triangles, mesh->triangle_count, &certificate));
    if (certificate.valid) {
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
