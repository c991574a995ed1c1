/* The map takes each vertex of the first rim to some point near the second one: the nearest point of that rim is where
 * it goes. That is neither smooth nor in order. So the difference to arc length is a function on the circle, sampled
 * evenly, which is smoothed until it keeps the order and stretches no more than it may. */
#include "align/map/rims/along.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"

enum {
  SAMPLES = 128,     /* of a rim: about as many as its vertices on meshes of 10,000 triangles */
  LEAST_ROUNDS = 8,  /* of smoothing: a vertex may be nearest to a wrong stretch of the rim */
  MOST_ROUNDS = 8192 /* after which the difference is constant */
};

/* Where the first rim goes on the second, as shares of their lengths: s ↦ s + shift + offset. */
typedef struct course {
  double shift, offset[SAMPLES];
} course;

/* To −0.5 … 0.5. */
static double wrapped(double x) {
  return x - floor(x + 0.5);
}

static double fraction(double x) {
  const double f = x - floor(x);
  return f < 1 ? f : 0;
}

static double share_at(const orb_rim_side *side, const orb_hole *hole, int32_t k) {
  return k < hole->count ? side->holes.at[hole->start + k] / hole->length : 1;
}

/* How far the second rim has come where the first one has come to s, 0 ≤ s ≤ 1. */
static double advance(const course *c, double s) {
  const double x = s * SAMPLES;
  const int i = (int)fmin(floor(x), SAMPLES - 1);
  const double t = x - i;
  return s + c->shift + (1 - t) * c->offset[i] + t * c->offset[(i + 1) % SAMPLES];
}

/* Where the first rim has come to where the second one has come to v: the inverse. 0 ≤ s < 1. */
static double retreat(const course *c, double v) {
  const double first = advance(c, 0);
  double low = 0, high = 1;
  v = first + fraction(v - first);
  for (int i = 0; i < 52; i++) {
    const double middle = 0.5 * (low + high);
    if (advance(c, middle) <= v) {
      low = middle;
    } else {
      high = middle;
    }
  }
  return low;
}

static int keeps_order(const orb_map_params *params, const course *c) {
  const double step = 1.0 / SAMPLES;
  for (int i = 0; i < SAMPLES; i++) {
    const double way = step + c->offset[(i + 1) % SAMPLES] - c->offset[i];
    if (way < params->rims.slowest * step || way > params->rims.fastest * step) {
      return 0;
    }
  }
  return 1;
}

static void smooth(course *c) {
  double last = c->offset[SAMPLES - 1], first = c->offset[0];
  for (int i = 0; i < SAMPLES; i++) {
    const double here = c->offset[i], next = i + 1 < SAMPLES ? c->offset[i + 1] : first;
    c->offset[i] = 0.25 * last + 0.5 * here + 0.25 * next;
    last = here;
  }
}

/* The position that the map gives to the point at share s of the first rim. *k: the edge of the last one, which comes
 * before. */
static void image_at(const orb_rim_side *side, const orb_hole *hole, double s, int32_t *k, double out[3]) {
  while (*k + 1 < hole->count && share_at(side, hole, *k + 1) <= s) {
    ++*k;
  }
  const double begin = share_at(side, hole, *k), end = share_at(side, hole, *k + 1);
  const double t = end > begin ? (s - begin) / (end - begin) : 0;
  const double *a = side->image + 3 * (size_t)(hole->start + *k);
  const double *b = side->image + 3 * (size_t)(hole->start + (*k + 1) % hole->count);
  for (int c = 0; c < 3; c++) {
    out[c] = (1 - t) * a[c] + t * b[c];
  }
}

static void follow_map(const orb_map_params *params, const orb_rim_side sides[2], const orb_hole *first,
                       const orb_hole *second, course *out) {
  double sum[2] = {0, 0};
  int32_t edge = 0;
  for (int i = 0; i < SAMPLES; i++) {
    double p[3], distance;
    const double s = (double)i / SAMPLES;
    image_at(&sides[0], first, s, &edge, p);
    out->offset[i] = orb_rim_nearest(&sides[1], second, p, &distance) - s;
    sum[0] += cos(2 * M_PI * out->offset[i]);
    sum[1] += sin(2 * M_PI * out->offset[i]);
  }
  out->shift = atan2(sum[1], sum[0]) / (2 * M_PI);
  for (int i = 0; i < SAMPLES; i++) {
    out->offset[i] = wrapped(out->offset[i] - out->shift);
  }
  for (int round = 0; round < LEAST_ROUNDS || (round < MOST_ROUNDS && !keeps_order(params, out)); round++) {
    smooth(out);
  }
}

/* A vertex of one of the rims: number k, and where it lies on the first and on the second rim. */
typedef struct stop {
  int rim;
  int32_t k;
  double s, v;
} stop;

static int compare(const void *a, const void *b) {
  const stop *one = a, *other = b;
  if (one->s != other->s) {
    return one->s < other->s ? -1 : 1;
  }
  return one->rim != other->rim ? one->rim - other->rim : one->k < other->k ? -1 : one->k > other->k;
}

/* The shorter of the two edges at vertex k, as a share of the rim. */
static double shorter_edge(const orb_rim_side *side, const orb_hole *hole, int32_t k) {
  const double before =
      share_at(side, hole, k > 0 ? k : hole->count) - share_at(side, hole, k > 0 ? k - 1 : hole->count - 1);
  return fmin(before, share_at(side, hole, k + 1) - share_at(side, hole, k));
}

static int are_one(double one, const orb_rim_side sides[2], const orb_hole *const hole[2], const stop *a,
                   const stop *b) {
  if (a->rim == b->rim) {
    return 0;
  }
  const stop *on[2] = {a->rim == 0 ? a : b, a->rim == 0 ? b : a};
  return fabs(wrapped(a->s - b->s)) < one * shorter_edge(&sides[0], hole[0], on[0]->k) &&
         fabs(wrapped(a->v - b->v)) < one * shorter_edge(&sides[1], hole[1], on[1]->k);
}

/* The place at share s of a rim. */
static orb_place place_at(const orb_rim_side *side, const orb_hole *hole, double s) {
  int32_t low = 0, high = hole->count;
  while (high - low > 1) {
    const int32_t middle = low + (high - low) / 2;
    if (share_at(side, hole, middle) <= s) {
      low = middle;
    } else {
      high = middle;
    }
  }
  const double begin = share_at(side, hole, low), end = share_at(side, hole, low + 1);
  const double t = end > begin ? fmin(fmax((s - begin) / (end - begin), 0), 1) : 0;
  return orb_place_on_half_edge(side->holes.half_edges[hole->start + low], t);
}

static orb_place place_of(const orb_rim_side *side, const orb_hole *hole, int32_t k) {
  return orb_place_on_half_edge(side->holes.half_edges[hole->start + k], 0);
}

static void add(orb_rim_points *points, orb_place first, orb_place second) {
  points->at[2 * (size_t)points->count] = first;
  points->at[2 * (size_t)points->count++ + 1] = second;
}

/* Turns the stops, in their order along the first rim, into points. */
static void write_points(double nearer, const orb_rim_side sides[2], const orb_hole *const hole[2], const stop *stops,
                         int32_t count, orb_rim_points *out) {
  const int wraps = count > 2 && are_one(nearer, sides, hole, &stops[count - 1], &stops[0]);
  for (int32_t i = wraps; i < count; i++) {
    const stop *one = &stops[i], *next = &stops[i + 1 < count ? i + 1 : 0];
    const int joins = i + 1 < count ? are_one(nearer, sides, hole, one, next) : wraps;
    if (joins) {
      const stop *on[2] = {one->rim == 0 ? one : next, one->rim == 0 ? next : one};
      add(out, place_of(&sides[0], hole[0], on[0]->k), place_of(&sides[1], hole[1], on[1]->k));
      i++;
    } else if (one->rim == 0) {
      add(out, place_of(&sides[0], hole[0], one->k), place_at(&sides[1], hole[1], one->v));
    } else {
      add(out, place_at(&sides[0], hole[0], one->s), place_of(&sides[1], hole[1], one->k));
    }
  }
}

void orb_rim_points_free(orb_context *ctx, orb_rim_points *points) {
  orb_free(ctx, points->at);
  memset(points, 0, sizeof *points);
}

orb_status orb_rims_along(orb_context *ctx, const orb_map_params *params, const orb_rim_side sides[2],
                          const orb_rim_pair *pair, int32_t most, orb_rim_points *points) {
  const orb_hole *const hole[2] = {&sides[0].holes.of[pair->hole[0]], &sides[1].holes.of[pair->hole[1]]};
  const int all = hole[0]->count + hole[1]->count <= most;
  const int32_t step = all ? 1 : 1 + (hole[0]->count - 1) / most;
  course c;
  int32_t count = 0;
  stop *stops = ORB_NEW(ctx, stop, (size_t)hole[0]->count + (size_t)hole[1]->count);
  orb_place *at = orb_realloc(
      ctx, points->at, 2 * ((size_t)points->count + (size_t)hole[0]->count + (size_t)hole[1]->count), sizeof *at);
  points->at = at ? at : points->at;
  if (!stops || !at) {
    orb_free(ctx, stops);
    return ORB_E_NO_MEMORY;
  }
  follow_map(params, sides, hole[0], hole[1], &c);
  for (int32_t k = 0; k < hole[0]->count; k += step) {
    const double s = share_at(&sides[0], hole[0], k);
    stops[count++] = (stop){0, k, s, fraction(advance(&c, s))};
  }
  for (int32_t k = 0; all && k < hole[1]->count; k++) {
    const double v = share_at(&sides[1], hole[1], k);
    stops[count++] = (stop){1, k, retreat(&c, v), v};
  }
  qsort(stops, (size_t)count, sizeof *stops, compare);
  write_points(params->rims.one, sides, hole, stops, count, points);
  orb_free(ctx, stops);
  return ORB_OK;
}
