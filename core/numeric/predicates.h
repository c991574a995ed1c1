/* Exact geometric predicates on doubles. */
#ifndef ORB_NUMERIC_PREDICATES_H
#define ORB_NUMERIC_PREDICATES_H

/* The exact sign (−1, 0, 1) of det(a, b, c): which way the spherical triangle a, b, c turns seen from outside. A static
 * filter decides almost always; else the six products are summed exactly in integers. Right for all finite doubles,
 * subnormal and huge ones included; a coordinate that is not finite gives 0. */
int orb_orient(const double a[3], const double b[3], const double c[3]);

#endif
