/* Makes an overlay valid after rounding. Most flipped triangles can be untangled. Where vertices of both layers lie
 * within rounding of each other (nearly equal meshes), there is no room between doubles, and the shortest edge of each
 * such triangle is collapsed instead. The merged vertices are recorded for the error bound. */
#include "remesh/overlay/repair.h"

#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"
#include "remesh/overlay/untangle.h"
#include "sphere/net.h"

/* Edges up to CLOSE · 4^round may collapse, in the last round up to about 1e-9: more than the rounding of points, about
 * 1e-16, and far less than any edge that a shape should have. */
enum { ROUNDS = 11 };
static const double CLOSE = 1e-15;

static int32_t shortest_edge(const orb_net *net, int32_t t) {
  int32_t best = 3 * t;
  double least = 8;
  for (int32_t h = 3 * t; h < 3 * t + 3; h++) {
    double length2 =
        orb_distance2(orb_net_point(net, net->triangles[h]), orb_net_point(net, net->triangles[orb_next(h)]));
    if (length2 < least) {
      least = length2;
      best = h;
    }
  }
  /* The vertex with the lower number stays. */
  return net->triangles[best] > net->triangles[orb_next(best)] ? best : net->twin[best];
}

/* Collapses the shortest edge of each flipped triangle, if it is no longer than the root of longest2. */
static orb_status merge_flipped(orb_context *ctx, orb_overlay *overlay, double longest2) {
  orb_net net;
  ORB_TRY(orb_net_init(ctx, &net, overlay->points, overlay->vertex_count, overlay->triangles, overlay->triangle_count,
                       NULL, overlay->vertex_count));
  orb_status status = ORB_OK;
  for (int32_t t = 0; t < net.triangle_count && status == ORB_OK; t++) {
    const int32_t *c = net.triangles + 3 * (int64_t)t;
    if (c[0] < 0 || orb_orient(orb_net_point(&net, c[0]), orb_net_point(&net, c[1]), orb_net_point(&net, c[2])) > 0) {
      continue;
    }
    int32_t h = shortest_edge(&net, t);
    if (orb_distance2(orb_net_point(&net, net.triangles[h]), orb_net_point(&net, net.triangles[orb_next(h)])) >
            longest2 ||
        !orb_net_can_collapse(&net, h)) {
      continue;
    }
    int32_t *merged = orb_realloc(ctx, overlay->merged, 2 * (size_t)(overlay->merged_count + 1), sizeof *merged);
    if (!merged) {
      status = ORB_E_NO_MEMORY;
      break;
    }
    overlay->merged = merged;
    merged[2 * overlay->merged_count] = net.triangles[h];
    merged[2 * overlay->merged_count++ + 1] = net.triangles[orb_next(h)];
    orb_net_collapse(&net, h);
  }
  int32_t live = 0;
  for (int32_t t = 0; t < net.triangle_count && status == ORB_OK; t++) {
    if (net.triangles[3 * t] >= 0) {
      memcpy(overlay->triangles + 3 * (int64_t)live, net.triangles + 3 * (int64_t)t, 3 * sizeof(int32_t));
      memcpy(overlay->parent + 2 * (int64_t)live, overlay->parent + 2 * (int64_t)t, 2 * sizeof(int32_t));
      live++;
    }
  }
  overlay->triangle_count = status == ORB_OK ? live : overlay->triangle_count;
  orb_net_free(ctx, &net);
  return status;
}

orb_status orb_overlay_repair(orb_context *ctx, orb_overlay *overlay) {
  int32_t first_free = overlay->layer[0].vertex_count + overlay->lone_count;
  size_t size = 3 * (size_t)overlay->vertex_count * sizeof(double);
  double *rounded = ORB_NEW(ctx, double, 3 * (int64_t)overlay->vertex_count), close = CLOSE;
  orb_status status = rounded ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    return status;
  }
  memcpy(rounded, overlay->points, size);
  for (int round = 0; round < ROUNDS; round++, close *= 4) {
    status = orb_overlay_untangle(ctx, overlay->points, overlay->vertex_count, overlay->triangles,
                                  overlay->triangle_count, first_free);
    if (status != ORB_E_NOT_CERTIFIED || round == ROUNDS - 1) {
      break;
    }
    orb_error_clear(ctx);
    memcpy(overlay->points, rounded, size); /* lengths are measured between the rounded points */
    ORB_GO(status, merge_flipped(ctx, overlay, close * close), end);
  }
end:
  orb_free(ctx, rounded);
  return status;
}
