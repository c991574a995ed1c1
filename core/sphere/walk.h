/* Point location by walking from a triangle to the one that holds a direction, by exact orientation tests. */
#ifndef ORB_SPHERE_WALK_H
#define ORB_SPHERE_WALK_H

#include <stdint.h>

/* A certified spherical triangulation, borrowed. Triangles whose first corner is negative are dead; no live one leads
 * to them. */
typedef struct orb_sphere_view {
  const double *points;
  const int32_t *triangles, *twin;
  int32_t triangle_count;
} orb_sphere_view;

/* Where a direction lies. side[k] is the sign of orient(corner k, corner k+1, p): all are ≥ 0; one 0 means on that
 * edge, two mean at the corner that both share. */
typedef struct orb_hit {
  int32_t triangle;
  int side[3];
} orb_hit;

/* Walks from `start` to a triangle that holds p, borders included. Tries edges in a pseudo-random order of fixed seed,
 * so that the walk cannot cycle; a walk of more steps than the mesh has triangles ends with a test of all. */
orb_hit orb_walk(const orb_sphere_view *mesh, const double p[3], int32_t start);

/* The corner (0..2) of the hit's triangle that p coincides with, or −1. */
int orb_hit_corner(const orb_hit *hit);

/* The half-edge of the triangle on whose interior p lies, or −1. */
int32_t orb_hit_edge(const orb_hit *hit);

/* Barycentric coordinates of p by central projection onto the flat triangle: ≥ 0, sum 1, exact at corners and with a
 * 0 on edges. */
void orb_project(const orb_sphere_view *mesh, const orb_hit *hit, const double p[3], double at[3]);

#endif
