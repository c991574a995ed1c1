/* Triangles that are turned in space against a shape, though none is turned on the sphere: the shape bends, or the map
 * to it shears, within the triangle. Turned edges or moved corners mend most; else an edge is split, for small enough
 * triangles follow the surface. */
#include <math.h>

#include "base/check.h"
#include "numeric/vec3.h"
#include "remesh/match.h"

enum { ROUNDS = 6 };

static int is_turned(const orb_match *match, int32_t t) {
  const int32_t *c = match->net.triangles + 3 * (int64_t)t;
  return c[0] >= 0 && orb_match_form(match, c[0], c[1], c[2]).facing <= 0;
}

/* The half-edge of t that is longest on the shapes, each in units of its diagonal. */
static int32_t longest_edge(const orb_match *match, int32_t t) {
  int32_t longest = 3 * t;
  double most = -1;
  for (int32_t h = 3 * t; h < 3 * t + 3; h++) {
    double length2 = 0;
    for (int32_t s = 0; s < match->shape_count; s++) {
      length2 += orb_distance2(orb_match_at(match, match->net.triangles[h], s),
                               orb_match_at(match, match->net.triangles[orb_next(h)], s));
    }
    if (length2 > most) {
      most = length2;
      longest = h;
    }
  }
  return longest;
}

static void tidy_around(orb_match *match, int32_t v, double limit2) {
  int32_t first = match->net.out[v], h = first, count = 0;
  do { /* a turn changes the ring: a few tries only */
    (void)orb_match_try_turn(match, orb_next(h), limit2);
    h = match->net.twin[orb_prev(h)];
  } while (h != first && ++count < 8);
  (void)orb_match_try_move(match, v, limit2);
}

static int mend_gently(orb_match *match, int32_t t, double limit2) {
  for (int k = 0; k < 3 && is_turned(match, t); k++) {
    (void)orb_match_try_turn(match, 3 * t + k, limit2);
  }
  for (int k = 0; k < 3 && is_turned(match, t); k++) {
    (void)orb_match_try_move(match, match->net.triangles[3 * (int64_t)t + k], limit2);
  }
  return !is_turned(match, t);
}

static orb_status mend_by_split(orb_context *ctx, orb_match *match, int32_t t, double limit2) {
  int32_t h = longest_edge(match, t);
  double middle[3];
  ORB_TRY(orb_match_reserve(ctx, match, 1));
  const double *a = orb_net_point(&match->net, match->net.triangles[h]);
  const double *b = orb_net_point(&match->net, match->net.triangles[orb_next(h)]);
  for (int k = 0; k < 3; k++) {
    middle[k] = a[k] + b[k];
  }
  (void)orb_normalize(middle);
  int32_t v = orb_match_split(match, h, middle);
  if (v >= 0) {
    tidy_around(match, v, limit2);
  }
  return ORB_OK;
}

orb_status orb_match_mend(orb_context *ctx, orb_match *match, double limit2, int64_t *left) {
  for (int round = 0; round < ROUNDS; round++) {
    int64_t turned = 0;
    int32_t count = match->net.triangle_count; /* those made on the way wait for the next round */
    for (int32_t t = 0; t < count; t++) {
      if (is_turned(match, t) && !mend_gently(match, t, limit2)) {
        turned++;
        if (round > 0) {
          ORB_TRY(mend_by_split(ctx, match, t, limit2));
        }
      }
      if ((t & 1023) == 0) {
        ORB_TRY(orb_context_check(ctx));
      }
    }
    *left = turned;
    if (turned == 0) {
      break;
    }
  }
  return ORB_OK;
}
