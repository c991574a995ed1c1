/* Synthetic aligned shapes for the remesh tests: certified spherical triangulations of several kinds, with surfaces
 * that are functions of the direction. */
#ifndef ORB_TESTS_SUPPORT_SPHERE_H
#define ORB_TESTS_SUPPORT_SPHERE_H

#include "orbmorph/remesh.h"

/* Kinds of triangulation. size: icosphere and octasphere the number of four-way splits, uv the number of rings. */
typedef enum sphere_kind { SPHERE_TETRA, SPHERE_OCTA, SPHERE_ICO, SPHERE_UV } sphere_kind;

/* A shape with points of the given kind, moved by a seeded jitter (0: none) and kept positive, rotated by a seeded
 * rotation if seed is not 0. Its surface is the bumpy, stretched ball of support_surface(). */
void sphere_shape(orb_context *ctx, sphere_kind kind, int size, double jitter, unsigned seed, orb_aligned_shape *out);
void sphere_shape_free(orb_context *ctx, orb_aligned_shape *shape);

/* The position of a shape in a direction, by testing every triangle: independent of locators. */
void sphere_evaluate(const orb_aligned_shape *shape, const double p[3], double out[3]);

/* The supermesh's surface for shape s in a direction, by testing every triangle. */
void sphere_evaluate_supermesh(const orb_supermesh *m, const orb_aligned_shape *shape, int s, const double p[3],
                               double out[3]);

/* A seeded unit vector. */
void sphere_random(uint64_t *state, double out[3]);
double sphere_uniform(uint64_t *state);
double sphere_diagonal(const orb_aligned_shape *shape);

/* Fails the test unless the supermesh is one sphere: Euler's count, each edge twice in opposite senses, orientations
 * positive, solid angles summing to 4π, places valid and unit points. */
void sphere_assert_valid(const orb_supermesh *m, const orb_aligned_shape *shapes, int count);

#endif
