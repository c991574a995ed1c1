/* The as-rigid-as-possible path from one shape to another of the same triangles. */
#ifndef ORB_TRANSFER_ARAP_H
#define ORB_TRANSFER_ARAP_H

#include "orbmorph/context.h"

typedef struct orb_arap orb_arap;

/* Prepares the path from a to b (3 per vertex, borrowed). O(V log V). */
ORB_MUST_CHECK orb_status orb_arap_create(orb_context *ctx, const double *a, const double *b, int32_t vertex_count,
                                          const int32_t *triangles, int32_t triangle_count, orb_arap **out);
void orb_arap_destroy(orb_context *ctx, orb_arap *path);

/* The positions at t in [0, 1]: a at 0, b at 1. Conjugate gradients, some hundred iterations of O(V). */
ORB_MUST_CHECK orb_status orb_arap_at(orb_context *ctx, orb_arap *path, double t, double *out);

/* The unit direction at vertex v at time t: `at_a` at 0, `at_b` at 1, in between rotating with the surface. */
void orb_arap_direction(const orb_arap *path, double t, int32_t v, const float at_a[3], const float at_b[3],
                        float out[3]);

#endif
