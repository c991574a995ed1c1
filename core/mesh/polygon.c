/* Polygons to triangles, in the plane of the mean normal (Newell).
 *
 * A quadrangle is cut along a diagonal that leaves both halves facing the same way; of two such diagonals, along the
 * shorter. Larger polygons lose ear after ear, never two neighbours in one round, which cuts a convex polygon into few
 * slivers. The search for points inside an ear has a budget that is linear in the number of corners, of this polygon
 * and of all polygons that share the scratch. When it is spent, or when a polygon crosses itself so that no ear is
 * left, the rest becomes a fan. So the result always has count − 2 triangles over the given corners.
 */
#include "mesh/polygon.h"

#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

/* Tests of a point against an ear. */
enum { TESTS_A_CORNER = 256, TESTS_AT_LEAST = 65536 }; /* of one polygon: a small one gets all that it needs */
static const int64_t FILE_TESTS_A_CORNER = 32, FILE_TESTS_AT_LEAST = 4 << 20; /* of all together */

orb_status orb_polygon_reserve(orb_context *ctx, orb_polygon *polygon, int32_t corners) {
  if (corners <= polygon->room) {
    return ORB_OK;
  }
  orb_polygon_free(ctx, polygon);
  polygon->flat = ORB_NEW(ctx, double, 2 * (size_t)corners);
  polygon->next = ORB_NEW(ctx, int32_t, corners);
  polygon->prev = ORB_NEW(ctx, int32_t, corners);
  polygon->reflex = ORB_NEW(ctx, int32_t, corners);
  if (!polygon->flat || !polygon->next || !polygon->prev || !polygon->reflex) {
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
  orb_free(ctx, polygon->reflex);
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

/* Twice the signed area of the triangle: positive for a left turn. */
static double signed_area2(const double *a, const double *b, const double *c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

static double distance2(const double *a, const double *b) {
  return (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]);
}

static void put(int32_t *out, int32_t a, int32_t b, int32_t c) {
  out[0] = a;
  out[1] = b;
  out[2] = c;
}

static void cut_quadrangle(const double *flat, int32_t *triangles) {
  const double *a = flat, *b = flat + 2, *c = flat + 4, *d = flat + 6;
  double ac = fmin(signed_area2(a, b, c), signed_area2(a, c, d)),
         bd = fmin(signed_area2(a, b, d), signed_area2(b, c, d));
  int first = ac > 0 && bd > 0 ? distance2(a, c) <= distance2(b, d) : ac >= bd;
  if (first) {
    put(triangles, 0, 1, 2);
    put(triangles + 3, 0, 2, 3);
  } else {
    put(triangles, 0, 1, 3);
    put(triangles + 3, 1, 2, 3);
  }
}

/* Whether no other corner lies in the ear a b c. If one does, so does one where the outline turns to the right. */
static int ear_is_free(orb_polygon *polygon, int32_t a, int32_t b, int32_t c, int64_t *budget) {
  const double *flat = polygon->flat, *pa = flat + 2 * a, *pb = flat + 2 * b, *pc = flat + 2 * c;
  for (int32_t n = 0; n < polygon->reflex_count;) {
    int32_t i = polygon->reflex[n];
    if (--*budget < 0) {
      return 0;
    }
    if (polygon->next[i] < 0) {
      polygon->reflex[n] = polygon->reflex[--polygon->reflex_count];
      continue;
    }
    const double *p = flat + 2 * i;
    int at_corner = i == b || (p[0] == pa[0] && p[1] == pa[1]) || (p[0] == pc[0] && p[1] == pc[1]);
    if (!at_corner && signed_area2(pa, pb, p) >= 0 && signed_area2(pb, pc, p) >= 0 && signed_area2(pc, pa, p) >= 0) {
      return 0;
    }
    n++;
  }
  return 1;
}

/* Links the corners and lists those that turn to the right. */
static void link_corners(orb_polygon *polygon, int32_t count) {
  const double *flat = polygon->flat;
  polygon->reflex_count = 0;
  for (int32_t i = 0; i < count; i++) {
    polygon->next[i] = i + 1 < count ? i + 1 : 0;
    polygon->prev[i] = i > 0 ? i - 1 : count - 1;
    if (!(signed_area2(flat + 2 * polygon->prev[i], flat + 2 * i, flat + 2 * polygon->next[i]) > 0)) {
      polygon->reflex[polygon->reflex_count++] = i;
    }
  }
}

static int is_convex(const double *flat, int32_t count) {
  for (int32_t i = 0; i < count; i++) {
    int32_t j = i + 1 < count ? i + 1 : 0, k = j + 1 < count ? j + 1 : 0;
    if (!(signed_area2(flat + 2 * i, flat + 2 * j, flat + 2 * k) > 0)) {
      return 0;
    }
  }
  /* every turn is to the left; the fan from corner 0 never turns back either, so they add up to one turn */
  for (int32_t i = 1; i + 1 < count; i++) {
    if (!(signed_area2(flat, flat + 2 * i, flat + 2 * i + 2) > 0)) {
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
  link_corners(polygon, count);
  int64_t own = TESTS_A_CORNER * (int64_t)count + TESTS_AT_LEAST;
  int64_t shared = FILE_TESTS_AT_LEAST + polygon->saved + FILE_TESTS_A_CORNER * (int64_t)count;
  int64_t given = own < shared ? own : shared, budget = given;
  int32_t at = 1, left = count, idle = 0;
  while (left > 3) {
    int32_t a = polygon->prev[at], c = polygon->next[at];
    int hopeless = idle > left || --budget < 0; /* a corner that is not an ear costs a test, too */
    const double *flat = polygon->flat;
    if (hopeless || convex ||
        (signed_area2(flat + 2 * a, flat + 2 * at, flat + 2 * c) > 0 && ear_is_free(polygon, a, at, c, &budget))) {
      put(triangles, a, at, c);
      triangles += 3;
      polygon->next[a] = c;
      polygon->prev[c] = a;
      polygon->next[at] = -1;
      left--;
      idle = 0;
      at = hopeless ? c : polygon->next[c];
    } else {
      idle++;
      at = c;
    }
  }
  put(triangles, polygon->prev[at], at, polygon->next[at]);
  polygon->saved += FILE_TESTS_A_CORNER * (int64_t)count - (given - (budget > 0 ? budget : 0));
}
