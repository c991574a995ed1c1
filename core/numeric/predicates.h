/* Exact geometric predicates on doubles. */
#ifndef ORB_NUMERIC_PREDICATES_H
#define ORB_NUMERIC_PREDICATES_H

#include <math.h>

/* The static filters, for determinants of two differences to a: |d| > ORB_ORIENT_RELATIVE · P + ORB_ORIENT_LEAST proves
 * the sign of d, where P bounds the sum of the products. predicates.c derives both. */
static const double ORB_ORIENT_RELATIVE = 1e-15, ORB_ORIENT_LEAST = 1e-220;

/* The exact sign (−1, 0, 1) of det(a, b, c): the orientation of the spherical triangle a, b, c seen from outside. A
 * static filter decides almost always; otherwise the six products are summed exactly in integers. Correct for all
 * finite doubles, subnormal and huge ones included; 0 if a coordinate is not finite. */
int orb_orient_careful(const double a[3], const double b[3], const double c[3]);

/* The same, with a coarser and cheaper filter first: it takes the product of the 1-norms for P. Where anything
 * overflows, so does the bound, and orb_orient_careful() decides. */
static inline int orb_orient(const double a[3], const double b[3], const double c[3]) {
  double ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2], wx = c[0] - a[0], wy = c[1] - a[1], wz = c[2] - a[2];
  double d = a[0] * (uy * wz - uz * wy) + a[1] * (uz * wx - ux * wz) + a[2] * (ux * wy - uy * wx);
  double size = fabs(a[0]) + fabs(a[1]) + fabs(a[2]);
  double bound = size * (fabs(ux) + fabs(uy) + fabs(uz)) * (fabs(wx) + fabs(wy) + fabs(wz));
  if (fabs(d) > ORB_ORIENT_RELATIVE * bound + ORB_ORIENT_LEAST && size <= 1e100) {
    return d > 0 ? 1 : -1;
  }
  return orb_orient_careful(a, b, c);
}

#endif
