/* Farthest-point sampling in space (Gonzalez 1985). */
#include <math.h>

#include "align/map/engine/spread.h"
#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

orb_status orb_map_spread(orb_context *ctx, const double *x, int32_t vertex_count, int32_t count, int32_t *out) {
  double *far = ORB_NEW(ctx, double, vertex_count);
  if (!far) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t v = 0; v < vertex_count; v++) {
    far[v] = INFINITY;
  }
  orb_status status = ORB_OK;
  for (int32_t i = 0, last = 0; i < count && status == ORB_OK; i++) {
    int32_t best = 0;
    for (int32_t v = 0; v < vertex_count; v++) {
      double d = orb_distance2(x + 3 * (size_t)v, x + 3 * (size_t)last);
      far[v] = d < far[v] ? d : far[v];
      best = far[v] > far[best] ? v : best;
    }
    out[i] = last = best;
    status = orb_context_check(ctx);
  }
  orb_free(ctx, far);
  return status;
}
