/* Rings around a limb of the fixed shape, and turns along them. See compose_limb.c. */
#ifndef ORB_ALIGN_MAP_TWIST_LIMB_H
#define ORB_ALIGN_MAP_TWIST_LIMB_H

#include "align/map/engine/surface.h"

/* The height above the rim of a part of the surface that is a disc: harmonic, 1 at the pole, 0 outside; its level
 * curves are rings about the pole, and along a tube they follow each other at even distances. inside: one flag a vertex
 * of the surface, the pole's set; height: one value a vertex. */
ORB_MUST_CHECK orb_status orb_map_limb_heights(orb_context *ctx, const orb_map_surface *b, const unsigned char *inside,
                                               int32_t pole, double *height);

/* Moves a place along its ring by an angle, counterclockwise as seen from outside with the pole in the middle. Angles
 * are those of the conjugate of the height: a full turn is 2π. All places of a ring keep their order, and rings theirs.
 * 0: the place is on no ring, and stays. */
int orb_map_limb_turn(const orb_map_surface *b, const double *height, double angle, orb_place *place);

#endif
