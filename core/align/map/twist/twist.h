/* Limbs that a composed map has twisted; twist.c describes the method. */
#ifndef ORB_ALIGN_MAP_TWIST_TWIST_H
#define ORB_ALIGN_MAP_TWIST_TWIST_H

#include "align/map/engine/params.h"
#include "align/map/twist/rotations.h"

/* A twisted limb: how far the map has rotated it around its axis, by the height above its root (limb.h), in radians.
 * Positive: counterclockwise as seen from outside with the tip in the middle. */
typedef struct orb_map_twist {
  int32_t pole; /* the tip, a vertex of the surface */
  int count;
  double height[ORB_MAP_BANDS + 1], angle[ORB_MAP_BANDS + 1];
  double most; /* the greatest angle, without sign */
} orb_map_twist;

typedef struct orb_map_twists {
  int32_t count;
  orb_map_twist limb[ORB_MAP_LIMBS];
  int32_t *of;    /* of each vertex of the surface: its limb, −1: none */
  double *height; /* in it; 0: none */
  double kept;    /* area of the mean of both shapes, relative to the mean of their areas; 1 for a rigid motion */
} orb_map_twists;

/* Finds the limbs that the map has twisted by more than a right angle. held: vertices of the surface whose partners are
 * known; a limb has at most one of them, which is its pole. O(n log n). */
ORB_MUST_CHECK orb_status orb_map_twists_find(orb_context *ctx, const orb_map_params *params, const orb_map_surface *b,
                                              const orb_map_image *map, const int32_t *held, int32_t held_count,
                                              orb_map_twists *out);
void orb_map_twists_free(orb_context *ctx, orb_map_twists *twists);

/* Rotates a place on a limb back by a share of its limb's twist there. 0: the place is on no limb and stays.
 * O(triangles around the limb). */
int orb_map_twists_undo(const orb_map_twists *twists, const orb_map_surface *b, double share, orb_place *place);

#endif
