/* The relief of a surface: how far each vertex stands out from its surroundings. */
#ifndef ORB_ELASTIC_RELIEF_H
#define ORB_ELASTIC_RELIEF_H

#include "elastic/body.h"

/* Sizes of surroundings that the height is measured against. */
enum { ORB_RELIEF_SIZES = 2 };

typedef struct orb_relief {
  double *height; /* ORB_RELIEF_SIZES per vertex, each of mean 0 and variance 1 over the surface */
  double *slope;  /* their gradients along the surface: 3 for each height */
} orb_relief;

/* The larger mean edge of two bodies: heights against smaller surroundings are noise of the triangles. */
double orb_relief_grain(const orb_body *a, const orb_body *b);

/* Heights and slopes. grain: from orb_relief_grain(). Free `out` in any case. O(n · size / edge), on all threads, with
 * the same bytes for any number of them. */
ORB_MUST_CHECK orb_status orb_relief_create(orb_context *ctx, const orb_body *body, double grain, orb_relief *out);
void orb_relief_free(orb_context *ctx, orb_relief *relief);

/* How little the reliefs of two bodies say of each other: the mean squared difference of heights between the vertices
 * of a and their places, vertices of b. One person in two poses has 0.1 to 0.2, two people have 0.2 to 0.35, and what
 * is unrelated has more. O(n). */
double orb_relief_noise(const orb_body *a, const orb_relief *relief_a, const orb_relief *relief_b,
                        const int32_t *place);

/* The step along b's surface, from a point near vertex u, towards the place where b has these heights. One damped
 * Gauss–Newton step, shortened to 0.4 of its length and to 0.04 radii at most. from: the point, relative to u. normal:
 * of b at u. noise: from orb_relief_noise(). */
void orb_relief_step(const double *height, const orb_relief *b, int32_t u, const double from[3], const double normal[3],
                     double noise, double step[3]);

#endif
