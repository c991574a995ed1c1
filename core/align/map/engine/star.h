/* The star of one vertex of a composed map: the energy of its triangles, and the Newton system of a step. Several
 * triangles are computed at once. Sums run in the order of the triangles, so that results do not depend on the width of
 * the machine's vectors. */
#ifndef ORB_ALIGN_MAP_ENGINE_STAR_H
#define ORB_ALIGN_MAP_ENGINE_STAR_H

#include "align/map/engine/level.h"

/* ORB_MAP_LANES triangles; vectors are stored by coordinate. Lanes beyond the last triangle hold harmless numbers. */
typedef struct orb_map_lanes {
  double q[3][ORB_MAP_LANES], r[3][ORB_MAP_LANES];   /* positions of the neighbours */
  double sq[3][ORB_MAP_LANES], sr[3][ORB_MAP_LANES]; /* and on the sphere */
  double normal[3][ORB_MAP_LANES];                   /* sum over the corners */
  double cv[ORB_MAP_LANES], cq[ORB_MAP_LANES], cr[ORB_MAP_LANES], area[ORB_MAP_LANES], density[ORB_MAP_LANES];
  double upright[ORB_MAP_LANES];                      /* length of that sum */
  double qr2[ORB_MAP_LANES];                          /* |r − q|² */
  double grow[3][ORB_MAP_LANES];                      /* signed area = ½ grow·(y − q) */
  double plane[3][ORB_MAP_LANES], det[ORB_MAP_LANES]; /* on the sphere: determinant = plane·x, and its value */
  double hinge[ORB_MAP_LANES],
      epsilon[ORB_MAP_LANES]; /* inverse of where the barrier begins; of the regularised area */
} orb_map_lanes;

typedef struct orb_map_star {
  const orb_map_params *params;
  int32_t count; /* triangles */
  int hinged;    /* some determinant is below where the barrier begins */
  orb_map_lanes lanes[ORB_MAP_RING_MAX / ORB_MAP_LANES];
} orb_map_star;

typedef struct orb_map_newton {
  double energy, g[2], h[3];
} orb_map_newton;

/* Loads the star of v, which has at most ORB_MAP_RING_MAX triangles. */
void orb_map_star_load(orb_map_star *star, const orb_map_level *level, int32_t v);

/* Energy, gradient and Hessian in the tangents e1, e2. j1 and j2 are the derivatives of the point on the sphere; where
 * j1 is NULL, the derivatives omit the barrier. Sets the lanes' ε. */
void orb_map_star_system(orb_map_star *star, const orb_map_rules *rules, const double y[3], const double *e1,
                         const double *e2, const double *j1, const double *j2, orb_map_newton *out);

/* Energy with the vertex at y, on the sphere at x; infinite where flips are not allowed and a determinant falls to
 * `shrink` times its value or less. Needs orb_map_star_system() before it. */
double orb_map_star_energy(const orb_map_star *star, const orb_map_rules *rules, const double y[3], const double x[3],
                           double shrink);

#endif
