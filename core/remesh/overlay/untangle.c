/* Repair of what rounding turned over. Crossings of edges are rounded to doubles; where one lies within rounding of a
 * third edge or of another vertex, a triangle of the exact arrangement can come out flat or turned. Its vertices are
 * moved towards the middle of their rings, by the smallest of halving steps that does best for their worst triangle,
 * until every triangle is positive. Places are not touched: what the supermesh reproduces stays exact, only where a
 * few of its vertices lie on the sphere changes in the last digits. */
#include "base/check.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"
#include "remesh/overlay/overlay.h"

enum { ROUNDS = 80, STEPS = 46 };

typedef struct knots {
  double *points;
  const int32_t *triangles;
  int32_t triangle_count, first_free;
  int32_t *begin, *corner; /* a vertex: its corners */
} knots;

static double *point(const knots *k, int32_t v) {
  return k->points + 3 * (int64_t)v;
}

static int is_bad(const knots *k, int32_t t) {
  const int32_t *c = k->triangles + 3 * (int64_t)t;
  return orb_orient(point(k, c[0]), point(k, c[1]), point(k, c[2])) <= 0;
}

/* The least height-like measure of v's triangles were it at p: determinant over the opposite edge; exact in sign. */
static double worst_at(const knots *k, int32_t v, const double p[3]) {
  double worst = 4;
  for (int32_t i = k->begin[v]; i < k->begin[v + 1]; i++) {
    int32_t h = k->corner[i];
    const double *a = point(k, k->triangles[orb_next(h)]), *b = point(k, k->triangles[orb_prev(h)]);
    double length = sqrt(orb_distance2(a, b)), height = length > 0 ? orb_det(p, a, b) / length : 0;
    int sign = orb_orient(p, a, b);
    if (sign <= 0 && height >= 0) {
      height = -1e-18;
    } else if (sign > 0 && height <= 0) {
      height = 1e-18;
    }
    worst = height < worst ? height : worst;
  }
  return worst;
}

static int relax(knots *k, int32_t v) {
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

static orb_status index_corners(orb_context *ctx, knots *k, int32_t vertex_count) {
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

/* All triangles near the bad ones get a turn; the bad ones are found anew each round. */
static int64_t relax_bad(knots *k, int32_t *bad, int64_t count, int wide) {
  for (int64_t i = 0; i < count; i++) {
    for (int c = 0; c < 3; c++) {
      int32_t v = k->triangles[3 * (int64_t)bad[i] + c];
      (void)relax(k, v);
      for (int32_t j = k->begin[v]; wide && j < k->begin[v + 1]; j++) {
        (void)relax(k, k->triangles[orb_next(k->corner[j])]);
      }
    }
  }
  int64_t left = 0;
  for (int64_t i = 0; i < count; i++) {
    if (is_bad(k, bad[i])) {
      bad[left++] = bad[i];
    }
  }
  return left;
}

orb_status orb_overlay_untangle(orb_context *ctx, double *points, int32_t vertex_count, const int32_t *triangles,
                                int32_t triangle_count, int32_t first_free) {
  knots k = {.points = points, .triangles = triangles, .triangle_count = triangle_count, .first_free = first_free};
  int32_t *bad = ORB_NEW(ctx, int32_t, triangle_count);
  orb_status status = bad ? ORB_OK : ORB_E_NO_MEMORY;
  int64_t left = 0;
  for (int round = 0; status == ORB_OK && round < ROUNDS; round++) {
    if (left == 0 || round % 20 == 0) { /* moves may have turned others: look at all */
      left = 0;
      for (int32_t t = 0; t < triangle_count; t++) {
        if (is_bad(&k, t)) {
          bad[left++] = t;
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
    left = relax_bad(&k, bad, left, round % 4 == 3);
    status = orb_context_check(ctx);
  }
  if (status == ORB_OK && left > 0) {
    status = orb_fail(ctx, ORB_E_NOT_CERTIFIED, "Rounding turned %lld triangles of the overlay that cannot be mended.",
                      (long long)left);
  }
end:
  orb_free(ctx, bad);
  orb_free(ctx, k.begin);
  orb_free(ctx, k.corner);
  return status;
}
