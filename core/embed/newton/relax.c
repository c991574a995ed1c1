#include "embed/newton/relax.h"

#include <math.h>

#include "base/check.h"
#include "embed/newton/multires.h"
#include "embed/newton/refiner.h"
#include "embed/newton/star.h"

orb_status orb_refiner_relax(orb_context *ctx, orb_refiner *r, int32_t v, double blend, double *gain,
                             double *crowding) {
  orb_star *star = &r->star[0];
  *gain = 0;
  if (crowding) {
    *crowding = 0;
  }
  if (r->pinned[v]) {
    return ORB_OK;
  }
  ORB_TRY(orb_star_walk(ctx, star, &r->hierarchy->surface, v, r->point));
  orb_star_shape(star, &r->hierarchy->surface, v, blend);
  double before, after = orb_star_newton(star, orb_refiner_energy(r), r->point + 4 * (int64_t)v, &before);
  if (isfinite(before) && before > 0) {
    *gain = (before - after) / before;
    if (crowding) {
      *crowding = after / (2 * star->area);
    }
  }
  return ORB_OK;
}
