#include "align/map/rims/pair.h"

#include <math.h>

#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"

/* Holes of a shape that are considered, the longest first: it bounds the time for a shape of cracks. */
enum { MOST = 32 };

/* Lengths are relative to the diagonals. */
static double length_of(const orb_rim_side *side, int32_t hole) {
  return side->holes.of[hole].length / side->diagonal;
}

/* The mean distance from where the map takes a rim to a rim there. */
static orb_status distance_from(orb_context *ctx, const orb_rim_side *from, int32_t rim, const orb_rim_side *to,
                                int32_t other, double *mean) {
  const orb_hole *hole = &from->holes.of[rim];
  double sum = 0;
  for (int32_t k = 0; k < hole->count; k++) {
    double distance;
    ORB_TRY(orb_context_check(ctx));
    (void)orb_rim_nearest(to, &to->holes.of[other], from->image + 3 * (size_t)(hole->start + k), &distance);
    sum += distance;
  }
  *mean = sum / hole->count / to->diagonal;
  return ORB_OK;
}

/* The longest holes whose rims are simple, longest first. Returns how many. */
static int32_t longest(const orb_rim_side *side, int32_t out[MOST]) {
  int32_t count = 0;
  for (int32_t i = 0; i < side->holes.count; i++) {
    if (!side->holes.of[i].is_simple || !(side->holes.of[i].length > 0)) {
      continue;
    }
    int32_t at = count < MOST ? count++ : MOST;
    for (; at > 0 && side->holes.of[out[at - 1]].length < side->holes.of[i].length; at--) {
      if (at < MOST) {
        out[at] = out[at - 1];
      }
    }
    if (at < MOST) {
      out[at] = i;
    }
  }
  return count;
}

/* *cost INFINITY: the two holes do not correspond. O(product of the edges of both). */
static orb_status find_cost(orb_context *ctx, const orb_map_params *params, const orb_rim_side sides[2], int32_t a,
                            int32_t b, int alone, double *cost) {
  const double lengths[2] = {length_of(&sides[0], a), length_of(&sides[1], b)};
  const double longer = fmax(lengths[0], lengths[1]) / fmin(lengths[0], lengths[1]);
  if (!(longer <= (alone ? params->rims.longer_alone : params->rims.longer))) {
    *cost = INFINITY;
    return ORB_OK;
  }
  double forth, back;
  ORB_TRY(distance_from(ctx, &sides[0], a, &sides[1], b, &forth));
  ORB_TRY(distance_from(ctx, &sides[1], b, &sides[0], a, &back));
  const double apart = 0.5 * (forth + back);
  *cost = alone || apart <= params->rims.apart * 0.5 * (lengths[0] + lengths[1]) ? apart : INFINITY;
  return ORB_OK;
}

orb_status orb_rims_pair(orb_context *ctx, const orb_map_params *params, const orb_rim_side sides[2],
                         orb_rim_pair **pairs, int32_t *count) {
  int32_t hole[2][MOST], holes[2] = {longest(&sides[0], hole[0]), longest(&sides[1], hole[1])};
  const int alone = holes[0] == 1 && holes[1] == 1;
  double cost[MOST][MOST];
  *count = 0;
  *pairs = ORB_NEW(ctx, orb_rim_pair, MOST);
  if (!*pairs) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t a = 0; a < holes[0]; a++) {
    for (int32_t b = 0; b < holes[1]; b++) {
      ORB_TRY(find_cost(ctx, params, sides, hole[0][a], hole[1][b], alone, &cost[a][b]));
    }
  }
  for (;;) {
    int32_t best[2] = {0, 0};
    double least = INFINITY;
    for (int32_t a = 0; a < holes[0]; a++) {
      for (int32_t b = 0; b < holes[1]; b++) {
        if (cost[a][b] < least) {
          least = cost[a][b];
          best[0] = a;
          best[1] = b;
        }
      }
    }
    if (!(least < INFINITY)) {
      return ORB_OK;
    }
    (*pairs)[(*count)++] = (orb_rim_pair){{hole[0][best[0]], hole[1][best[1]]}};
    for (int32_t i = 0; i < MOST; i++) {
      cost[best[0]][i] = cost[i][best[1]] = INFINITY;
    }
  }
}
