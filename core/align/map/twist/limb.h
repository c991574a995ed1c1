/* Rings around a limb of the fixed shape, and rotations along them; limb.c describes the method. */
#ifndef ORB_ALIGN_MAP_TWIST_LIMB_H
#define ORB_ALIGN_MAP_TWIST_LIMB_H

#include "align/map/engine/params.h"
#include "align/map/engine/surface.h"

/* The height above the rim of a part of the surface that is a disc: harmonic, 1 at the pole, 0 outside. Its level
 * curves are rings around the pole; along a tube they follow each other at even distances. inside: one flag for each
 * vertex of the surface, with the pole's set; height: one value for each vertex. */
ORB_MUST_CHECK orb_status orb_map_limb_heights(orb_context *ctx, const orb_map_params *params, const orb_map_surface *b,
                                               const unsigned char *inside, int32_t pole, double *height);

/* Moves a place along its ring by an angle, counterclockwise as seen from outside with the pole in the middle. Angles
 * are those of the conjugate of the height: the whole ring is 2π. All places of a ring keep their order, and so do the
 * rings. 0: the place is on no ring and stays. */
int orb_map_limb_rotate(const orb_map_surface *b, const double *height, double angle, orb_place *place);

#endif
