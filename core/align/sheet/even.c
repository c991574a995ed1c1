#include "align/sheet/even.h"

#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "base/tasks.h"
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

static orb_status embed_shape(orb_context *ctx, void *arg, int32_t s) {
  const orb_even_shapes *even = arg;
  orb_align_shape *shape = &even->shapes[s];
  int valid;
  double *points = even->points[s] = ORB_NEW(ctx, double, 3 * (size_t)shape->mesh->vertex_count);
  if (!points) {
    return ORB_E_NO_MEMORY;
  }
  ORB_TRY(embed(ctx, shape->mesh, points, &valid));
  shape->points = valid ? points : shape->points;
  return ORB_OK;
}

orb_status orb_even_shapes_create(orb_context *ctx, const orb_align_shape *shapes, int32_t count,
                                  orb_even_shapes *out) {
  *out = (orb_even_shapes){ORB_NEW(ctx, orb_align_shape, count), ORB_NEW0(ctx, double *, count), count};
  if (!out->shapes || !out->points) {
    return ORB_E_NO_MEMORY;
  }
  memcpy(out->shapes, shapes, (size_t)count * sizeof *shapes);
  return orb_tasks_run(ctx, count, embed_shape, out);
}

void orb_even_shapes_free(orb_context *ctx, orb_even_shapes *even) {
  for (int32_t s = 0; even->points && s < even->count; s++) {
    orb_free(ctx, even->points[s]);
  }
  orb_free(ctx, even->points);
  orb_free(ctx, even->shapes);
  memset(even, 0, sizeof *even);
}
