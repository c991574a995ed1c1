/* Removing a vertex and filling its hole in the best way. */
#ifndef ORB_REMESH_ADAPTIVE_FILL_H
#define ORB_REMESH_ADAPTIVE_FILL_H

#include "remesh/placed/placed_net.h"

/* Plans to remove u and to triangulate its hole within the limit (relative, squared). ring: the n neighbours of u,
 * counter-clockwise. triangles receives n − 2 triples of indices into the ring. strict: as for orb_adaptive_collapse().
 * Returns 0 where there is no way. Changes nothing: from any thread. */
int orb_adaptive_plan_fill(const orb_placed_net *placed, int32_t u, const int32_t *ring, int n, double limit2,
                           int strict, int (*triangles)[3]);
/* Carries out the plan. Touches nothing beyond the ring. */
void orb_adaptive_fill(orb_placed_net *placed, int32_t u, const int32_t *ring, int n, int (*triangles)[3]);

#endif
