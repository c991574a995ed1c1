/* Exact geometric predicates on doubles. */
#ifndef ORB_NUMERIC_PREDICATES_H
#define ORB_NUMERIC_PREDICATES_H

/* The exact sign (−1, 0, 1) of det(a, b, c): which way the spherical triangle a, b, c turns seen from outside. A static
 * filter decides almost always; else expansions (Shewchuk 1997). Right for all finite doubles, also where products
 * under- or overflow. */
int orb_orient(const double a[3], const double b[3], const double c[3]);

#endif
