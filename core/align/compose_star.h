/* The star of one vertex of a composed map: the energy of its triangles, and the Newton system of a step. Several
 * triangles are computed at once; sums are taken in the order of the triangles, so that results are the same for every
 * width of the machine's vectors. */
#ifndef ORB_ALIGN_COMPOSE_STAR_H
#define ORB_ALIGN_COMPOSE_STAR_H

#include "align/compose_level.h"

enum { CM_RING_MAX = 256, CM_LANES = 8 };

/* Eight triangles; vectors are stored by coordinate. Lanes beyond the last triangle hold harmless numbers. */
typedef struct cm_lanes {
  double q[3][CM_LANES], r[3][CM_LANES];   /* positions of the neighbours */
  double sq[3][CM_LANES], sr[3][CM_LANES]; /* and on the sphere */
  double normal[3][CM_LANES];              /* sum over the corners */
  double cv[CM_LANES], cq[CM_LANES], cr[CM_LANES], area[CM_LANES], density[CM_LANES];
  double upright[CM_LANES];                  /* length of that sum */
  double qr2[CM_LANES];                      /* |r − q|² */
  double grow[3][CM_LANES];                  /* signed area = ½ grow·(y − q) */
  double plane[3][CM_LANES], det[CM_LANES];  /* sphere: determinant = plane·x, and what it is */
  double hinge[CM_LANES], epsilon[CM_LANES]; /* 1 over where the barrier begins; of the regularised area */
} cm_lanes;

typedef struct cm_star {
  int32_t count; /* triangles */
  int hinged;    /* some determinant is below where the barrier begins */
  cm_lanes lanes[CM_RING_MAX / CM_LANES];
} cm_star;

typedef struct cm_newton {
  double energy, g[2], h[3];
} cm_newton;

/* Loads the star of v, which has at most CM_RING_MAX triangles. */
void cm_star_load(cm_star *star, const cm_level *level, int32_t v);

/* Energy, gradient and Hessian in the tangents e1, e2, without the barrier's derivatives where j1, the derivative of
 * the point on the sphere, is NULL. Sets the lanes' ε. */
void cm_star_system(cm_star *star, const cm_rules *rules, const double y[3], const double *e1, const double *e2,
                    const double *j1, const double *j2, cm_newton *out);

/* Energy with the vertex at y, on the sphere at x; infinite where flips are not allowed and a determinant falls to
 * `shrink` times what it was. cm_star_system() comes first. */
double cm_star_energy(const cm_star *star, const cm_rules *rules, const double y[3], const double x[3], double shrink);

#endif
