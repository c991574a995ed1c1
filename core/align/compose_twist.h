/* Limbs that a composed map has turned about their own axes. See compose_twist.c. */
#ifndef ORB_ALIGN_COMPOSE_TWIST_H
#define ORB_ALIGN_COMPOSE_TWIST_H

#include "align/compose.h"

/* A map onto a surface: a shape, scaled like the surface, and its points on the surface's sphere. */
typedef struct cm_image {
  int32_t vertex_count, triangle_count;
  const int32_t *triangles;
  const double *x, *points; /* 3 a vertex; without flips */
} cm_image;

enum { CM_LIMBS = 12, CM_BANDS = 16 };

/* A twisted limb: how far the map has turned it, by the height above its root (compose_limb.h), in radians. Positive:
 * counterclockwise as seen from outside with the tip in the middle. */
typedef struct cm_twist {
  int32_t pole; /* the tip, a vertex of the surface */
  int count;
  double height[CM_BANDS + 1], angle[CM_BANDS + 1];
  double most; /* the greatest angle, without sign */
} cm_twist;

typedef struct cm_twists {
  int32_t count;
  cm_twist limb[CM_LIMBS];
  int32_t *of;    /* of each vertex of the surface: its limb, -1: none */
  double *height; /* in it; 0: none */
  double kept;    /* of the area of both shapes in the mean, how much their mean has; 1 where all goes straight */
} cm_twists;

/* The limbs that the map has twisted by more than a right angle. held: vertices of the surface whose partners are
 * known: of a limb at most one, which is its pole. O(n log n). */
ORB_MUST_CHECK orb_status cm_twists_find(orb_context *ctx, const cm_surface *b, const cm_image *map,
                                         const int32_t *held, int32_t held_count, cm_twists *out);
void cm_twists_free(orb_context *ctx, cm_twists *twists);

/* Turns a place on a limb back by a share of its limb's twist there. 0: it is on no limb, and stays. O(triangles around
 * the limb). */
int cm_twists_undo(const cm_twists *twists, const cm_surface *b, double share, orb_place *place);

/* Of every vertex of the surface: where it comes from (back, 3 a vertex) and the angle by which the map turns its
 * surroundings in space, against the rotation of the whole (turn). *kept: as in cm_twists (compose_turns.c). O(n). */
ORB_MUST_CHECK orb_status cm_turns_measure(orb_context *ctx, const cm_surface *b, const cm_image *map, double *back,
                                           double *turn, double *kept);

#endif
