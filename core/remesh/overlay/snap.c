/* Vertices of a layer that lie within rounding of one of the layer below move there, bit for bit. A shape over a copy
 * of itself that was rotated by almost nothing would otherwise cross its own edges a thousand times, where no double
 * lies between them. The moved sphere has the same triangles, all positive; as the overlay is exact for the spheres
 * that it gets, every vertex and edge of the shape is still there. */
#include "remesh/overlay/snap.h"

#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

enum { CHECK_EVERY = 4096 }; /* vertices between two checks for cancellation */
/* Distance on the unit sphere: far above the rounding of a rotation, far below the edges of a mesh. */
static const double ROUNDING = 1e-9;

/* Whether all triangles around the origin of half-edge h are positive. */
static int is_positive_around(const orb_sphere_view *view, const double *points, int32_t h) {
  int32_t first = h;
  do {
    const int32_t *c = view->triangles + h - h % 3;
    if (orb_orient(points + 3 * (int64_t)c[0], points + 3 * (int64_t)c[1], points + 3 * (int64_t)c[2]) <= 0) {
      return 0;
    }
    h = orb_next(view->twin[h]);
  } while (h != first);
  return 1;
}

/* The corner of the triangle at p that lies within rounding of p, or −1. */
static int32_t corner_near(const orb_layer *below, const double p[3], int32_t *hint) {
  orb_place place;
  orb_locate(below->locator, p, *hint, &place);
  *hint = place.triangle;
  for (int k = 0; k < 3; k++) {
    int32_t v = below->view.triangles[3 * (int64_t)place.triangle + k];
    if (orb_distance2(below->view.points + 3 * (int64_t)v, p) <= ROUNDING * ROUNDING) {
      return v;
    }
  }
  return -1;
}

orb_status orb_overlay_snap(orb_context *ctx, const orb_layer *below, const orb_layer *layer, double *points,
                            int32_t *snapped) {
  const orb_sphere_view *view = &layer->view;
  int32_t *half = ORB_NEW(ctx, int32_t, layer->vertex_count), hint = -1;
  if (!half) {
    return ORB_E_NO_MEMORY;
  }
  orb_status status = ORB_OK;
  *snapped = 0;
  memcpy(points, view->points, 3 * (size_t)layer->vertex_count * sizeof *points);
  for (int32_t h = 0; h < 3 * view->triangle_count; h++) {
    half[view->triangles[h]] = h;
  }
  for (int32_t v = 0; v < layer->vertex_count && status == ORB_OK; v++) {
    double *p = points + 3 * (int64_t)v, old[3];
    int32_t to = corner_near(below, p, &hint);
    if (to >= 0) {
      memcpy(old, p, sizeof old);
      memcpy(p, below->view.points + 3 * (int64_t)to, sizeof old);
      if (is_positive_around(view, points, half[v])) {
        *snapped += memcmp(p, old, sizeof old) != 0;
      } else {
        memcpy(p, old, sizeof old);
      }
    }
    status = v % CHECK_EVERY == 0 ? orb_context_check(ctx) : ORB_OK;
  }
  orb_free(ctx, half);
  return status;
}
