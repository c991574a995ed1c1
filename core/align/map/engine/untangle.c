/* Untangling on the sphere: the neighbourhoods of flips are optimised until every triangle is positive.
 *
 * The vertices of flipped triangles, and of a growing number of rings around them, take damped Newton steps of
 * Σ D / χ(d): D is the Dirichlet energy of the triangle from an equilateral one, d = det(p, q, r), and
 * χ(d) = ½(d + √(d² + ε²)) is the regularised positive part of d. ε follows the worst determinant of the star down, so
 * that the energy stays finite while there are flips and becomes a barrier as they disappear (Garanzha et al.,
 * Foldover-free maps in 50 lines of code, 2021).
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/map/engine/untangle.h"
#include "base/check.h"
#include "base/forest.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/frame.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

enum { FLIP_GRAIN = 1024, CHECK_EVERY = 4096 }; /* triangles of one task; vertices between checks for cancellation */
enum { RING_ROUNDS = 4 };                       /* rounds after which one more ring around the flips may move */
enum { SHARED_ROUNDS = 3 };                     /* one in this many rounds with many flips has an ε for each star */
static const double LEAST_EPSILON = 1e-100;     /* keeps ε above 0 in a star whose triangles are all points */
static const double LONGEST_STEP = 0.5; /* radians, about: the energy of a longer one is not that of the plane */

static double chi(double d, double e) {
  double root = sqrt(d * d + e * e);
  return d >= 0 ? 0.5 * (d + root) : 0.5 * e * e / (root - d) + ORB_TINY;
}

static const double *point(const orb_map_level *l, int32_t v) {
  return l->x + 3 * (size_t)v;
}

static double star_energy(const orb_map_level *l, int32_t v, const double p[3], double epsilon) {
  double energy = 0;
  for (int32_t i = l->start[v]; i < l->start[v + 1]; i++) {
    const double *q = point(l, l->spoke[i].q), *r = point(l, l->spoke[i].r);
    double d = orb_distance2(p, q) + orb_distance2(p, r) + orb_distance2(q, r);
    energy += d / chi(orb_det(p, q, r), epsilon);
  }
  return energy;
}

/* ε for the star of v: small against its determinants, and against the worst of them. */
static double star_epsilon(const orb_map_level *l, int32_t v) {
  double sum = 0, worst = 0;
  for (int32_t i = l->start[v]; i < l->start[v + 1]; i++) {
    double det = orb_det(point(l, v), point(l, l->spoke[i].q), point(l, l->spoke[i].r));
    sum += fabs(det);
    worst = fmin(worst, det);
  }
  const orb_map_params *params = l->params;
  return params->untangle.star_mean * sum / (l->start[v + 1] - l->start[v]) - params->untangle.star_worst * worst +
         LEAST_EPSILON;
}

/* One step of v; the point only changes where the energy falls. */
static void step(orb_map_level *l, int32_t v, double least_epsilon) {
  double epsilon = fmax(star_epsilon(l, v), least_epsilon);
  double *p = l->x + 3 * (size_t)v, e1[3], e2[3], g[2] = {0, 0}, h[3] = {0, 0, 0}, energy = 0, longest = 0;
  orb_tangent_frame(p, e1, e2);
  for (int32_t i = l->start[v]; i < l->start[v + 1]; i++) {
    const double *q = point(l, l->spoke[i].q), *r = point(l, l->spoke[i].r);
    double side[3], plane[3], u[3], w[3];
    orb_sub(r, q, side);
    orb_cross(q, side, plane);
    orb_sub(p, q, u);
    orb_sub(p, r, w);
    double d = orb_dot(u, u) + orb_dot(w, w) + orb_dot(side, side), det = orb_dot(plane, p);
    double d1 = 2 * (orb_dot(u, e1) + orb_dot(w, e1)), d2 = 2 * (orb_dot(u, e2) + orb_dot(w, e2));
    double s1 = orb_dot(plane, e1), s2 = orb_dot(plane, e2);
    double root = sqrt(det * det + epsilon * epsilon), c = chi(det, epsilon), c1 = c / root;
    double c2 = 0.5 * epsilon * epsilon / (root * root * root);
    double f = 1 / c, fp = -c1 / (c * c), fpp = fmax(0, 2 * c1 * c1 / (c * c * c) - c2 / (c * c));
    energy += d * f;
    g[0] += f * d1 + d * fp * s1;
    g[1] += f * d2 + d * fp * s2;
    h[0] += 4 * f + 2 * fp * d1 * s1 + d * fpp * s1 * s1;
    h[1] += fp * (d1 * s2 + d2 * s1) + d * fpp * s1 * s2;
    h[2] += 4 * f + 2 * fp * d2 * s2 + d * fpp * s2 * s2;
    longest = fmax(longest, orb_dot(u, u));
  }
  double mean = 0.5 * (h[0] + h[2]), spread = sqrt(0.25 * (h[0] - h[2]) * (h[0] - h[2]) + h[1] * h[1]);
  double low = mean - spread, floor = l->params->untangle.convexity * fmax(fabs(mean + spread), fabs(low)),
         lift = low < floor ? floor - low : 0;
  double a = h[0] + lift, b = h[1], c = h[2] + lift, det = a * c - b * b;
  double s = -(c * g[0] - b * g[1]) / det, t = -(a * g[1] - b * g[0]) / det, length = sqrt(s * s + t * t);
  if (!(det > 0) || !(length > 0)) {
    return;
  }
  double most = fmin(LONGEST_STEP, sqrt(longest)), scale = length > most ? most / length : 1;
  for (int tries = 0; tries < l->params->untangle.tries; tries++, scale *= l->params->untangle.shorten) {
    double moved[3];
    for (int k = 0; k < 3; k++) {
      moved[k] = p[k] + scale * (s * e1[k] + t * e2[k]);
    }
    orb_normalize(moved);
    if (star_energy(l, v, moved, epsilon) < energy) {
      memcpy(p, moved, sizeof moved);
      return;
    }
  }
}

typedef struct flip_job {
  const orb_map_level *l;
  unsigned char *flipped; /* of each triangle */
} flip_job;

static void flip_range(void *arg, int64_t begin, int64_t end, int thread) {
  const flip_job *job = arg;
  const orb_map_level *l = job->l;
  (void)thread;
  for (int64_t t = begin; t < end; t++) {
    const int32_t *v = l->triangle + 3 * t;
    job->flipped[t] = orb_orient(point(l, v[0]), point(l, v[1]), point(l, v[2])) <= 0;
  }
}

/* Marks the vertices of flipped triangles; returns the number of these, and in *worst the least determinant. */
static int32_t mark_flips(orb_context *ctx, flip_job *job, unsigned char *mark, double *worst) {
  const orb_map_level *l = job->l;
  int32_t flips = 0;
  orb_parallel_for(ctx, l->triangle_count, FLIP_GRAIN, flip_range, job);
  memset(mark, 0, (size_t)l->count);
  *worst = 0;
  for (int32_t t = 0; t < l->triangle_count; t++) {
    const int32_t *v = l->triangle + 3 * (size_t)t;
    if (job->flipped[t]) {
      mark[v[0]] = mark[v[1]] = mark[v[2]] = 1;
      *worst = fmin(*worst, orb_det(point(l, v[0]), point(l, v[1]), point(l, v[2])));
      flips++;
    }
  }
  return flips;
}

void orb_map_level_grow_marks(const orb_map_level *l, int rings, unsigned char *mark, unsigned char *next) {
  for (int ring = 0; ring < rings; ring++) {
    memcpy(next, mark, (size_t)l->count);
    for (int32_t t = 0; t < l->triangle_count; t++) {
      const int32_t *v = l->triangle + 3 * (size_t)t;
      if (mark[v[0]] || mark[v[1]] || mark[v[2]]) {
        next[v[0]] = next[v[1]] = next[v[2]] = 1;
      }
    }
    memcpy(mark, next, (size_t)l->count);
  }
}

orb_status orb_map_level_mark_flips(orb_context *ctx, const orb_map_level *l, int rings, unsigned char *mark,
                                    unsigned char *next) {
  double worst;
  flip_job job = {l, ORB_NEW(ctx, unsigned char, l->triangle_count)};
  if (!job.flipped) {
    return ORB_E_NO_MEMORY;
  }
  (void)mark_flips(ctx, &job, mark, &worst);
  orb_map_level_grow_marks(l, rings, mark, next);
  orb_free(ctx, job.flipped);
  return ORB_OK;
}

/* A part of the marked vertices that no edge joins to another part. Steps in one part do not see the others, so each
 * runs on a thread of its own with its vertices in order, and the result does not depend on the number of threads. */
typedef struct island {
  int32_t first, size;
} island;

typedef struct islands {
  orb_context *ctx;
  orb_map_level *level;
  double least_epsilon;
  int32_t count;
  island *list;
  int32_t *part;   /* forest; −1: the vertex stays */
  int32_t *order;  /* vertices by island */
  int32_t *number; /* of an island, by its lowest vertex */
} islands;

static int by_size(const void *a, const void *b) {
  const island *x = a, *y = b;
  return x->size != y->size ? (x->size < y->size) - (x->size > y->size) : (x->first > y->first) - (x->first < y->first);
}

/* Joins marked vertices along edges; the lowest vertex of each island represents it. */
static void join_islands(islands *is, const unsigned char *mark) {
  const orb_map_level *l = is->level;
  for (int32_t v = 0; v < l->count; v++) {
    is->part[v] = mark[v] && !l->pinned[v] ? v : -1;
  }
  for (int32_t v = 0; v < l->count; v++) {
    for (int32_t i = l->start[v]; is->part[v] >= 0 && i < l->start[v + 1]; i++) {
      int32_t q = l->spoke[i].q;
      if (is->part[q] >= 0) {
        orb_forest_join(is->part, v, q);
      }
    }
  }
}

/* Lists the islands, the largest first. Returns the number of vertices that will move. */
static int32_t list_islands(islands *is) {
  int32_t n = is->level->count, total = 0;
  is->count = 0;
  for (int32_t v = 0; v < n; v++) {
    if (is->part[v] >= 0) {
      is->part[v] = orb_forest_root(is->part, v);
      if (is->part[v] == v) {
        is->number[v] = is->count;
        is->list[is->count++] = (island){0, 0};
      }
      is->list[is->number[is->part[v]]].size++;
    }
  }
  for (int32_t i = 0; i < is->count; i++) {
    is->list[i].first = total;
    total += is->list[i].size;
    is->list[i].size = 0;
  }
  for (int32_t v = 0; v < n; v++) {
    if (is->part[v] >= 0) {
      island *at = &is->list[is->number[is->part[v]]];
      is->order[at->first + at->size++] = v;
    }
  }
  qsort(is->list, (size_t)is->count, sizeof *is->list, by_size);
  return total;
}

static void untangle_range(void *arg, int64_t begin, int64_t end, int thread) {
  const islands *is = arg;
  (void)thread;
  for (int64_t k = begin; k < end; k++) {
    const int32_t *vertex = is->order + is->list[k].first;
    for (int pass = 0; pass < is->level->params->untangle.passes; pass++) {
      for (int32_t i = 0; i < is->list[k].size; i++) {
        if (i % CHECK_EVERY == 0 && orb_context_check(is->ctx) != ORB_OK) {
          return; /* orb_map_level_untangle() reports it */
        }
        step(is->level, vertex[i], is->least_epsilon);
      }
    }
  }
}

orb_status orb_map_level_untangle(orb_context *ctx, orb_map_level *l, int32_t *left, int64_t *work) {
  size_t n = (size_t)l->count;
  unsigned char *mark = ORB_NEW(ctx, unsigned char, 2 * n), *next = mark ? mark + n : NULL;
  flip_job job = {l, ORB_NEW(ctx, unsigned char, l->triangle_count)};
  islands is = {.ctx = ctx, .level = l, .part = ORB_NEW(ctx, int32_t, 3 * n), .list = ORB_NEW(ctx, island, n)};
  const orb_map_params *params = l->params;
  orb_status status = mark && job.flipped && is.part && is.list ? ORB_OK : ORB_E_NO_MEMORY;
  int32_t fewest = INT32_MAX;
  int stale = 0; /* rounds since the number of flips last fell */
  is.order = is.part ? is.part + n : NULL;
  is.number = is.part ? is.part + 2 * n : NULL;
  for (int round = 0; status == ORB_OK; round++) {
    double worst;
    *left = mark_flips(ctx, &job, mark, &worst);
    stale = *left < fewest ? 0 : stale + 1;
    fewest = *left < fewest ? *left : fewest;
    if (*left == 0 || round == params->untangle.rounds || stale > params->untangle.stale) {
      break;
    }
    int rings = 1 + round / RING_ROUNDS;
    orb_map_level_grow_marks(l, rings < params->untangle.rings_most ? rings : params->untangle.rings_most, mark, next);
    /* Many flips need one ε for all; the last few hide in stars that are far smaller. */
    double scale = 1.0 / l->triangle_count;
    is.least_epsilon =
        *left > params->untangle.few && round % SHARED_ROUNDS
            ? sqrt(params->untangle.all_mean2 * scale * scale + params->untangle.all_worst2 * worst * worst)
            : 0;
    join_islands(&is, mark);
    *work -= params->untangle.passes * (int64_t)list_islands(&is);
    orb_parallel_for(ctx, is.count, 1, untangle_range, &is);
    status = orb_context_check(ctx);
  }
  orb_free(ctx, mark);
  orb_free(ctx, job.flipped);
  orb_free(ctx, is.part);
  orb_free(ctx, is.list);
  return status;
}
