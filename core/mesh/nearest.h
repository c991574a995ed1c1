/* Nearest points beyond the public queries. */
#ifndef ORB_MESH_NEAREST_H
#define ORB_MESH_NEAREST_H

#include "orbmorph/mesh.h"

/* The answer of orb_nearest_query() without a bound, bit for bit, but sooner, the nearer `known` is: a place with its
 * squared distance, both as orb_triangle_nearest() gave them, or triangle −1 if there is none. */
double orb_nearest_query_from(const orb_nearest *tree, const double p[3], const orb_place *known,
                              double known_distance2, orb_place *out);

/* The nearest point of the triangle of these three corners (9 numbers): its coordinates; returns the squared distance.
 * A triangle without area counts as its edges. */
double orb_triangle_nearest(const double *corners, const double p[3], double at[3]);

#endif
