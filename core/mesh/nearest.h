/* Nearest points beyond the public queries. */
#ifndef ORB_MESH_NEAREST_H
#define ORB_MESH_NEAREST_H

#include "orbmorph/mesh.h"

/* The result of orb_nearest_query() without a bound, bit for bit, but faster the nearer `known` is: a place with its
 * squared distance, both from orb_triangle_nearest(), or triangle −1 if none is known. */
double orb_nearest_query_from(const orb_nearest *tree, const double p[3], const orb_place *known,
                              double known_distance2, orb_place *out);

/* The nearest point to p of the triangle with these corners (9 numbers): sets its barycentric coordinates, returns the
 * squared distance. A triangle without area counts as its edges. */
double orb_triangle_nearest(const double *corners, const double p[3], double at[3]);

#endif
