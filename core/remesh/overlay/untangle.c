/* Untangles what rounding flipped. Crossings of edges are rounded to doubles; where one lies within rounding of a third
 * edge or of another vertex, a triangle of the exact arrangement can come out degenerate or flipped. Its vertices move
 * towards the middle of their rings, each by the step, of a sequence of halved steps, that is best for its worst
 * triangle, until every triangle is positive. Places are not touched: what the supermesh reproduces stays exact, only
 * the points of a few vertices on the sphere change in the last digits. */
#include "remesh/overlay/untangle.h"

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"
#include "orbmorph/mesh.h"

enum { ROUNDS = 80 }; /* in the second half, input vertices may move too */
enum { STEPS = 46 };  /* halvings of the way to the middle: down to 2⁻⁴⁵, about the rounding of a double */
/* Every ALL_EVERY rounds all triangles are tested, because moves may flip others. Every WIDE_EVERY rounds the
 * neighbours of flipped triangles move too. Smaller numbers cost more time. */
enum { ALL_EVERY = 20, WIDE_EVERY = 4 };

/* Height that stands for one that rounding gave the wrong sign: below every one that is computed right. */
static const double FLAT = 1e-18;

typedef struct untangler {
  double *points;
  const int32_t *triangles;
  int32_t triangle_count, first_free;
  int32_t *begin, *corner; /* corners of vertex v: corner[begin[v]] … corner[begin[v + 1] − 1] */
} untangler;

static double *point(const untangler *k, int32_t v) {
  return k->points + 3 * (int64_t)v;
}

static int is_flipped(const untangler *k, int32_t t) {
  const int32_t *c = k->triangles + 3 * (int64_t)t;
  return orb_orient(point(k, c[0]), point(k, c[1]), point(k, c[2])) <= 0;
}

/* The least of a measure like height (determinant over the opposite edge) of v's triangles, with v at p. Its sign is
 * exact. */
static double worst_at(const untangler *k, int32_t v, const double p[3]) {
  double worst = 4;
  for (int32_t i = k->begin[v]; i < k->begin[v + 1]; i++) {
    int32_t h = k->corner[i];
    const double *a = point(k, k->triangles[orb_next(h)]), *b = point(k, k->triangles[orb_prev(h)]);
    double length = sqrt(orb_distance2(a, b)), height = length > 0 ? orb_det(p, a, b) / length : 0;
    int sign = orb_orient(p, a, b);
    if (sign <= 0 && height >= 0) {
      height = -FLAT;
    } else if (sign > 0 && height <= 0) {
      height = FLAT;
    }
    worst = height < worst ? height : worst;
  }
  return worst;
}

/* Moves v to the best point on the way to the middle of its ring. Returns whether it moved. */
static int relax(untangler *k, int32_t v) {
  if (v < k->first_free) {
    return 0;
  }
  double middle[3] = {0, 0, 0}, best[3] = {0, 0, 0}, *p = point(k, v), now = worst_at(k, v, p), most = now;
  for (int32_t i = k->begin[v]; i < k->begin[v + 1]; i++) {
    const double *a = point(k, k->triangles[orb_next(k->corner[i])]);
    for (int j = 0; j < 3; j++) {
      middle[j] += a[j];
    }
  }
  (void)orb_normalize(middle);
  double blend = 1;
  for (int step = 0; step < STEPS; step++, blend *= 0.5) {
    double q[3];
    for (int j = 0; j < 3; j++) {
      q[j] = p[j] + blend * (middle[j] - p[j]);
    }
    (void)orb_normalize(q);
    double value = worst_at(k, v, q);
    if (value > most) {
      most = value;
      best[0] = q[0];
      best[1] = q[1];
      best[2] = q[2];
    }
  }
  if (!(most > now)) {
    return 0;
  }
  p[0] = best[0];
  p[1] = best[1];
  p[2] = best[2];
  return 1;
}

static orb_status index_corners(orb_context *ctx, untangler *k, int32_t vertex_count) {
  k->begin = ORB_NEW0(ctx, int32_t, vertex_count + 2);
  k->corner = ORB_NEW(ctx, int32_t, 3 * (int64_t)k->triangle_count);
  if (!k->begin || !k->corner) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t h = 0; h < 3 * k->triangle_count; h++) {
    k->begin[k->triangles[h] + 2]++;
  }
  for (int32_t v = 0; v < vertex_count; v++) {
    k->begin[v + 2] += k->begin[v + 1];
  }
  for (int32_t h = 0; h < 3 * k->triangle_count; h++) {
    k->corner[k->begin[k->triangles[h] + 1]++] = h;
  }
  return ORB_OK;
}

/* Moves the corners of the listed triangles, and if `wide` their neighbours. Keeps the triangles that are still flipped
 * in the list; returns how many. */
static int64_t relax_flipped(untangler *k, int32_t *flipped, int64_t count, int wide) {
  for (int64_t i = 0; i < count; i++) {
    for (int c = 0; c < 3; c++) {
      int32_t v = k->triangles[3 * (int64_t)flipped[i] + c];
      (void)relax(k, v);
      for (int32_t j = k->begin[v]; wide && j < k->begin[v + 1]; j++) {
        (void)relax(k, k->triangles[orb_next(k->corner[j])]);
      }
    }
  }
  int64_t left = 0;
  for (int64_t i = 0; i < count; i++) {
    if (is_flipped(k, flipped[i])) {
      flipped[left++] = flipped[i];
    }
  }
  return left;
}

orb_status orb_overlay_untangle(orb_context *ctx, double *points, int32_t vertex_count, const int32_t *triangles,
                                int32_t triangle_count, int32_t first_free) {
  untangler k = {.points = points, .triangles = triangles, .triangle_count = triangle_count, .first_free = first_free};
  int32_t *flipped = ORB_NEW(ctx, int32_t, triangle_count);
  orb_status status = flipped ? ORB_OK : ORB_E_NO_MEMORY;
  int64_t left = 0;
  for (int round = 0; status == ORB_OK && round < ROUNDS; round++) {
    if (left == 0 || round % ALL_EVERY == 0) {
      left = 0;
      for (int32_t t = 0; t < triangle_count; t++) {
        if (is_flipped(&k, t)) {
          flipped[left++] = t;
        }
      }
    }
    if (left == 0) {
      break;
    }
    if (!k.begin) {
      ORB_GO(status, index_corners(ctx, &k, vertex_count), end);
    }
    k.first_free = round < ROUNDS / 2 ? first_free : 0;
    left = relax_flipped(&k, flipped, left, round % WIDE_EVERY == WIDE_EVERY - 1);
    status = orb_context_check(ctx);
  }
  if (status == ORB_OK && left > 0) {
    status = orb_fail(ctx, ORB_E_NOT_CERTIFIED,
                      "Rounding flipped %lld triangles of the overlay that cannot be untangled.", (long long)left);
  }
end:
  orb_free(ctx, flipped);
  orb_free(ctx, k.begin);
  orb_free(ctx, k.corner);
  return status;
}
