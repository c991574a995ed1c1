/* Distances in space between simplices. Each is the distance of two points that lie in the simplices, so it never
 * underestimates how far a point of one must move to reach the other. */
#ifndef ORB_REMESH_PLACED_DISTANCE_H
#define ORB_REMESH_PLACED_DISTANCE_H

#include <math.h>

#include "numeric/vec3.h"

/* Sine squared between two sides below which a triangle is too flat for coordinates in it. */
static const double ORB_FLAT = 1e-8;

static inline double orb_clamp01(double x) {
  return x > 0 ? (x < 1 ? x : 1) : 0; /* NaN: 0 */
}

/* Squared distance from p to the segment a b. */
static inline double orb_point_segment2(const double p[3], const double a[3], const double b[3]) {
  double ab[3], ap[3], d[3];
  orb_sub(b, a, ab);
  orb_sub(p, a, ap);
  double t = orb_clamp01(orb_dot(ab, ap) / orb_dot(ab, ab));
  for (int k = 0; k < 3; k++) {
    d[k] = ap[k] - t * ab[k];
  }
  return orb_dot(d, d);
}

/* Squared distance between the segments a b and c d (Ericson, Real-Time Collision Detection, 5.1.9). */
static inline double orb_segments2(const double a[3], const double b[3], const double c[3], const double d[3]) {
  double u[3], v[3], r[3], g[3];
  orb_sub(b, a, u);
  orb_sub(d, c, v);
  orb_sub(a, c, r);
  double uu = orb_dot(u, u), vv = orb_dot(v, v), uv = orb_dot(u, v), ur = orb_dot(u, r), vr = orb_dot(v, r);
  double s = orb_clamp01((uv * vr - ur * vv) / (uu * vv - uv * uv));
  double t = orb_clamp01((uv * s + vr) / vv);
  s = orb_clamp01((uv * t - ur) / uu);
  for (int k = 0; k < 3; k++) {
    g[k] = r[k] + s * u[k] - t * v[k];
  }
  return orb_dot(g, g);
}

/* Squared distance from p to the triangle a b c. */
static inline double orb_point_triangle2(const double p[3], const double a[3], const double b[3], const double c[3]) {
  double u[3], v[3], w[3];
  orb_sub(b, a, u);
  orb_sub(c, a, v);
  orb_sub(p, a, w);
  double uu = orb_dot(u, u), uv = orb_dot(u, v), vv = orb_dot(v, v), wu = orb_dot(w, u), wv = orb_dot(w, v);
  double det = uu * vv - uv * uv, s = (vv * wu - uv * wv) / det, t = (uu * wv - uv * wu) / det;
  double inside = INFINITY;
  if (s >= 0 && t >= 0 && s + t <= 1) {
    double d[3];
    for (int k = 0; k < 3; k++) {
      d[k] = w[k] - s * u[k] - t * v[k];
    }
    inside = orb_dot(d, d);
    if (det > ORB_FLAT * uu * vv) {
      return inside;
    } /* else s and t are mostly rounding, and a side may be nearer */
  }
  double best = orb_point_segment2(p, a, b), other = orb_point_segment2(p, b, c);
  best = other < best ? other : best;
  other = orb_point_segment2(p, c, a);
  best = other < best ? other : best;
  return inside < best ? inside : best;
}

#endif
