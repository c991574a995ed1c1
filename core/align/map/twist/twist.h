/* Limbs that a composed map has twisted; twist.c describes the method. */
#ifndef ORB_ALIGN_MAP_TWIST_TWIST_H
#define ORB_ALIGN_MAP_TWIST_TWIST_H

#include "align/map/engine/params.h"
#include "align/map/twist/bands.h"
#include "align/map/twist/rotations.h"

typedef struct orb_map_twists {
  int32_t count;
  orb_map_twist limb[ORB_MAP_LIMBS];
  int32_t *of;    /* of each vertex of the surface: its limb, −1: none */
  double *height; /* in it; 0: none */
  double kept;    /* area of the mean of both shapes, relative to the mean of their areas; 1 for a rigid motion */
} orb_map_twists;

/* Finds the limbs that the map has twisted by more than a right angle, and those that it has wound by whole turns.
 * held: vertices of the surface whose partners are known. One on a twisted limb is its pole; one or more may lie beyond
 * a wound limb, and those on it hide the winding. O(n log n), a dozen times if held vertices are on
 * posed parts. */
ORB_MUST_CHECK orb_status orb_map_twists_find(orb_context *ctx, const orb_map_params *params, const orb_map_surface *b,
                                              const orb_map_image *map, const int32_t *held, int32_t held_count,
                                              orb_map_twists *out);
void orb_map_twists_free(orb_context *ctx, orb_map_twists *twists);

/* Rotates a place on a limb back by a share of its limb's twist there. A wound limb has no shares: its places are
 * rotated back by all of it if unwinds is 1, and stay if it is 0. Returns 0 if the place stays. O(triangles around the
 * limb). */
int orb_map_twists_undo(const orb_map_twists *twists, const orb_map_surface *b, double share, int unwinds,
                        orb_place *place);

#endif
