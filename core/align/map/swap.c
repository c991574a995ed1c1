/* Which of two shapes moves. */
#include "align/map/swap.h"

#include "align/map/engine/surface.h"
#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

enum { CHECK_EVERY = 4096 }; /* vertices between checks for cancellation; a power of two */

/* The share of a shape's triangles whose images on another shape are inverted: against its interpolated normals. */
static orb_status inverted_share(orb_context *ctx, const orb_aligned_shape *from, const orb_aligned_shape *to,
                                 double *share) {
  const orb_mesh *mesh = &from->mesh;
  orb_map_surface b;
  int32_t inverted = 0;
  ORB_TRY(orb_map_surface_create(ctx, to, &b));
  double *image = ORB_NEW(ctx, double, 6 * (size_t)mesh->vertex_count);
  orb_status status = image ? ORB_OK : ORB_E_NO_MEMORY;
  orb_place place = {.triangle = -1};
  for (int32_t v = 0; v < mesh->vertex_count && status == ORB_OK; v++) {
    double *y = image + 6 * (size_t)v;
    orb_locate(b.locator, from->points + 3 * (size_t)v, place.triangle, &place);
    orb_map_surface_at(&b, &place, y, NULL, y + 3);
    status = (v & (CHECK_EVERY - 1)) == CHECK_EVERY - 1 ? orb_context_check(ctx) : ORB_OK;
  }
  for (int32_t t = 0; t < mesh->triangle_count && status == ORB_OK; t++) {
    const int32_t *v = mesh->triangles + 3 * (size_t)t;
    const double *p = image + 6 * (size_t)v[0], *q = image + 6 * (size_t)v[1], *r = image + 6 * (size_t)v[2];
    double u[3], w[3], n[3];
    orb_sub(q, p, u);
    orb_sub(r, p, w);
    orb_cross(u, w, n);
    inverted += orb_dot(n, p + 3) + orb_dot(n, q + 3) + orb_dot(n, r + 3) < 0;
  }
  *share = (double)inverted / mesh->triangle_count;
  orb_free(ctx, image);
  orb_map_surface_free(ctx, &b);
  return status;
}

orb_status orb_map_should_swap(orb_context *ctx, const orb_map_params *params, const orb_aligned_shape *fixed,
                               const orb_aligned_shape *moving, int *swap) {
  double here, there;
  ORB_TRY(inverted_share(ctx, moving, fixed, &here));
  ORB_TRY(inverted_share(ctx, fixed, moving, &there));
  *swap = here > params->swap.share + params->swap.ratio * there;
  return ORB_OK;
}
