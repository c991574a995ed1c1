/* Polygons to triangles, in the plane of the mean normal (Newell).
 *
 * A quadrangle takes the shorter of its diagonals that leaves both halves facing the same way. Larger ones are clipped
 * ear by ear, never two neighbours in one round, which cuts a convex polygon into few slivers. The search for points
 * inside an ear has a budget that is linear in the number of corners; when it is spent, or a polygon crosses itself so
 * that no ear is left, the rest becomes a fan: the result always has count − 2 triangles over the given corners.
 */
#include "mesh/polygon.h"

#include "base/check.h"
#include "numeric/vec3.h"

orb_status orb_polygon_reserve(orb_context *ctx, orb_polygon *polygon, int32_t corners) {
  if (corners <= polygon->room) {
    return ORB_OK;
  }
  orb_polygon_free(ctx, polygon);
  polygon->flat = ORB_NEW(ctx, double, 2 * (size_t)corners);
  polygon->next = ORB_NEW(ctx, int32_t, corners);
  polygon->prev = ORB_NEW(ctx, int32_t, corners);
  if (!polygon->flat || !polygon->next || !polygon->prev) {
    orb_polygon_free(ctx, polygon);
    return ORB_E_NO_MEMORY;
  }
  polygon->room = corners;
  return ORB_OK;
}

void orb_polygon_free(orb_context *ctx, orb_polygon *polygon) {
  orb_free(ctx, polygon->flat);
  orb_free(ctx, polygon->next);
  orb_free(ctx, polygon->prev);
  *polygon = (orb_polygon){0};
}

/* Coordinates in the mean plane, counter-clockwise. */
static void flatten(orb_polygon *polygon, const double *positions, const int32_t *vertex, int32_t count) {
  double normal[3] = {0, 0, 0};
  const double *origin = positions + 3 * (size_t)vertex[0];
  for (int32_t i = 1; i + 1 < count; i++) {
    double u[3], w[3], n[3];
    orb_sub(positions + 3 * (size_t)vertex[i], origin, u);
    orb_sub(positions + 3 * (size_t)vertex[i + 1], origin, w);
    orb_cross(u, w, n);
    for (int k = 0; k < 3; k++) {
      normal[k] += n[k];
    }
  }
  if (!(orb_normalize(normal) > 0)) {
    normal[0] = normal[1] = 0;
    normal[2] = 1;
  }
  double axis[3] = {0, 0, 0}, across[3], up[3];
  int least = fabs(normal[0]) < fabs(normal[1]) ? (fabs(normal[0]) < fabs(normal[2]) ? 0 : 2)
                                                : (fabs(normal[1]) < fabs(normal[2]) ? 1 : 2);
  axis[least] = 1;
  orb_cross(normal, axis, across);
  orb_normalize(across);
  orb_cross(normal, across, up);
  for (int32_t i = 0; i < count; i++) {
    double d[3];
    orb_sub(positions + 3 * (size_t)vertex[i], origin, d);
    polygon->flat[2 * i] = orb_dot(d, across);
    polygon->flat[2 * i + 1] = orb_dot(d, up);
  }
}

static double turn(const double *a, const double *b, const double *c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

static double span2(const double *a, const double *b) {
  return (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]);
}

static void put(int32_t *out, int32_t a, int32_t b, int32_t c) {
  out[0] = a;
  out[1] = b;
  out[2] = c;
}

static void cut_quadrangle(const double *flat, int32_t *triangles) {
  const double *a = flat, *b = flat + 2, *c = flat + 4, *d = flat + 6;
  double ac = fmin(turn(a, b, c), turn(a, c, d)), bd = fmin(turn(a, b, d), turn(b, c, d));
  int first = ac > 0 && bd > 0 ? span2(a, c) <= span2(b, d) : ac >= bd;
  if (first) {
    put(triangles, 0, 1, 2);
    put(triangles + 3, 0, 2, 3);
  } else {
    put(triangles, 0, 1, 3);
    put(triangles + 3, 1, 2, 3);
  }
}

/* No other corner lies in the ear a b c. */
static int ear_is_free(const orb_polygon *polygon, int32_t a, int32_t b, int32_t c, int64_t *budget) {
  const double *flat = polygon->flat, *pa = flat + 2 * a, *pb = flat + 2 * b, *pc = flat + 2 * c;
  for (int32_t i = polygon->next[c]; i != a; i = polygon->next[i]) {
    if (--*budget < 0) {
      return 0;
    }
    const double *p = flat + 2 * i;
    int at_corner = (p[0] == pa[0] && p[1] == pa[1]) || (p[0] == pc[0] && p[1] == pc[1]);
    if (!at_corner && turn(pa, pb, p) >= 0 && turn(pb, pc, p) >= 0 && turn(pc, pa, p) >= 0) {
      return 0;
    }
  }
  return 1;
}

static int is_convex(const double *flat, int32_t count) {
  for (int32_t i = 0; i < count; i++) {
    int32_t j = i + 1 < count ? i + 1 : 0, k = j + 1 < count ? j + 1 : 0;
    if (!(turn(flat + 2 * i, flat + 2 * j, flat + 2 * k) > 0)) {
      return 0;
    }
  }
  /* all turns left, and once round: the fan from corner 0 never turns back */
  for (int32_t i = 1; i + 1 < count; i++) {
    if (!(turn(flat, flat + 2 * i, flat + 2 * i + 2) > 0)) {
      return 0;
    }
  }
  return 1;
}

void orb_polygon_cut(orb_polygon *polygon, const double *positions, const int32_t *vertex, int32_t count,
                     int32_t *triangles) {
  ORB_ASSERT(count >= 3);
  if (count == 3) {
    put(triangles, 0, 1, 2);
    return;
  }
  ORB_ASSERT(count <= polygon->room);
  flatten(polygon, positions, vertex, count);
  if (count == 4) {
    cut_quadrangle(polygon->flat, triangles);
    return;
  }
  int convex = is_convex(polygon->flat, count);
  for (int32_t i = 0; i < count; i++) {
    polygon->next[i] = i + 1 < count ? i + 1 : 0;
    polygon->prev[i] = i > 0 ? i - 1 : count - 1;
  }
  int64_t budget = 256 * (int64_t)count + 65536;
  int32_t at = 1, left = count, idle = 0;
  while (left > 3) {
    int32_t a = polygon->prev[at], c = polygon->next[at];
    int hopeless = idle > left || budget < 0;
    const double *flat = polygon->flat;
    if (hopeless || convex ||
        (turn(flat + 2 * a, flat + 2 * at, flat + 2 * c) > 0 && ear_is_free(polygon, a, at, c, &budget))) {
      put(triangles, a, at, c);
      triangles += 3;
      polygon->next[a] = c;
      polygon->prev[c] = a;
      left--;
      idle = 0;
      at = hopeless ? c : polygon->next[c];
    } else {
      idle++;
      at = c;
    }
  }
  put(triangles, polygon->prev[at], at, polygon->next[at]);
}
