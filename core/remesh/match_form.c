/* How the net's triangles lie in space. */
#include <math.h>

#include "numeric/vec3.h"
#include "remesh/match.h"

static const double FINE_QUALITY = 0.12, FINE_FACING = 0.05;

orb_form orb_match_form(const orb_match *match, int32_t a, int32_t b, int32_t c) {
  orb_form worst = ORB_FORM_BEST;
  for (int32_t s = 0; s < match->shape_count; s++) {
    double u[3], v[3], n[3], ground[3];
    const double *p = orb_match_at(match, a, s), *q = orb_match_at(match, b, s), *r = orb_match_at(match, c, s);
    orb_sub(q, p, u);
    orb_sub(r, p, v);
    orb_cross(u, v, n);
    double edges = orb_dot(u, u) + orb_dot(v, v) + orb_distance2(q, r), area2 = orb_length(n);
    for (int k = 0; k < 3; k++) {
      ground[k] =
          orb_match_normal(match, a, s)[k] + orb_match_normal(match, b, s)[k] + orb_match_normal(match, c, s)[k];
    }
    worst.quality = fmin(worst.quality, edges > 0 ? 3.4641016151377544 * area2 / edges : 0);
    worst.facing = fmin(worst.facing, area2 > 0 ? orb_dot(n, ground) / (3 * area2) : 0);
  }
  worst.slivers = worst.quality < FINE_QUALITY;
  worst.turned = worst.facing < FINE_FACING;
  return worst;
}

int orb_form_allows(orb_form before, orb_form after) {
  if (after.turned < before.turned) {
    return 1;
  }
  return (after.slivers < before.slivers || after.quality >= fmin(before.quality, FINE_QUALITY)) &&
         after.facing >= fmin(before.facing, FINE_FACING);
}
