/* How a map rotates the surroundings of each vertex in space. */
#ifndef ORB_ALIGN_MAP_TWIST_ROTATIONS_H
#define ORB_ALIGN_MAP_TWIST_ROTATIONS_H

#include "align/map/engine/surface.h"

/* A map onto a surface: a shape, scaled like the surface, and its points on the surface's sphere. */
typedef struct orb_map_image {
  int32_t vertex_count, triangle_count;
  const int32_t *triangles;
  const double *x, *points; /* 3 per vertex; without flips */
} orb_map_image;

/* For every vertex of the surface: where it comes from (back, 3 per vertex), and how the map rotates its surroundings
 * in space (rotation, 9 per vertex; zeros where that is not defined). whole: the rotation of the whole, or the
 * identity. *kept: as in orb_map_twists (twist.h). O(n). */
ORB_MUST_CHECK orb_status orb_map_rotations_measure(orb_context *ctx, const orb_map_surface *b,
                                                    const orb_map_image *map, double *back, double *rotation,
                                                    double whole[9], double *kept);

/* Only *kept. O(n). */
ORB_MUST_CHECK orb_status orb_map_rotations_kept(orb_context *ctx, const orb_map_surface *b, const orb_map_image *map,
                                                 double *kept);

/* The angle between two rotations, in radians; 0 if one of them is not defined. */
double orb_map_rotations_angle(const double a[9], const double b[9]);

#endif
