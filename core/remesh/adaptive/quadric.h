/* Quadric error (Garland & Heckbert 1997): the area-weighted sum of squared distances to planes. */
#ifndef ORB_REMESH_ADAPTIVE_QUADRIC_H
#define ORB_REMESH_ADAPTIVE_QUADRIC_H

#include "numeric/vec3.h"

/* x'Ax + 2b'x + c; the symmetric A is stored as xx, xy, xz, yy, yz, zz. */
typedef struct orb_quadric {
  double a[6], b[3], c;
} orb_quadric;

static inline void orb_quadric_add(orb_quadric *q, const orb_quadric *other) {
  for (int k = 0; k < 6; k++) {
    q->a[k] += other->a[k];
  }
  for (int k = 0; k < 3; k++) {
    q->b[k] += other->b[k];
  }
  q->c += other->c;
}

/* Adds the plane of a triangle, weighted by a third of its area; a degenerate triangle adds nothing. */
static inline void orb_quadric_add_plane(orb_quadric *q, const double p0[3], const double p1[3], const double p2[3]) {
  double u[3], v[3], n[3];
  orb_sub(p1, p0, u);
  orb_sub(p2, p0, v);
  orb_cross(u, v, n);
  double area2 = orb_normalize(n), w = area2 / 6, d = -orb_dot(n, p0);
  q->a[0] += w * n[0] * n[0];
  q->a[1] += w * n[0] * n[1];
  q->a[2] += w * n[0] * n[2];
  q->a[3] += w * n[1] * n[1];
  q->a[4] += w * n[1] * n[2];
  q->a[5] += w * n[2] * n[2];
  for (int k = 0; k < 3; k++) {
    q->b[k] += w * d * n[k];
  }
  q->c += w * d * d;
}

static inline double orb_quadric_at(const orb_quadric *q, const double x[3]) {
  return q->a[0] * x[0] * x[0] + q->a[3] * x[1] * x[1] + q->a[5] * x[2] * x[2] +
         2 * (q->a[1] * x[0] * x[1] + q->a[2] * x[0] * x[2] + q->a[4] * x[1] * x[2]) +
         2 * (q->b[0] * x[0] + q->b[1] * x[1] + q->b[2] * x[2]) + q->c;
}

#endif
