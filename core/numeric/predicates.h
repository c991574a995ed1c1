/* Exact geometric predicates on doubles. */
#ifndef ORB_NUMERIC_PREDICATES_H
#define ORB_NUMERIC_PREDICATES_H

#include <math.h>

/* The exact sign (−1, 0, 1) of det(a, b, c): which way the spherical triangle a, b, c turns seen from outside. A static
 * filter decides almost always; else the six products are summed exactly in integers. Right for all finite doubles,
 * subnormal and huge ones included; a coordinate that is not finite gives 0. */
int orb_orient_careful(const double a[3], const double b[3], const double c[3]);

/* The same, with a coarser and cheaper filter in front: 1e-15 times the product of the 1-norms is no less than the
 * bound that predicates.c derives; where something overflows it does too, and the careful way decides. */
static inline int orb_orient(const double a[3], const double b[3], const double c[3]) {
  double ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2], wx = c[0] - a[0], wy = c[1] - a[1], wz = c[2] - a[2];
  double d = a[0] * (uy * wz - uz * wy) + a[1] * (uz * wx - ux * wz) + a[2] * (ux * wy - uy * wx);
  double size = fabs(a[0]) + fabs(a[1]) + fabs(a[2]);
  double bound = size * (fabs(ux) + fabs(uy) + fabs(uz)) * (fabs(wx) + fabs(wy) + fabs(wz));
  if (fabs(d) > 1e-15 * bound + 1e-220 && size <= 1e100) {
    return d > 0 ? 1 : -1;
  }
  return orb_orient_careful(a, b, c);
}

#endif
