/* Rings around a limb of the fixed shape, and rotations along them; limb.c describes the method. */
#ifndef ORB_ALIGN_MAP_TWIST_LIMB_H
#define ORB_ALIGN_MAP_TWIST_LIMB_H

#include "align/map/engine/params.h"
#include "align/map/engine/surface.h"

/* The height above the rim of a part of the surface that is a disc: harmonic, 1 at its end, 0 outside. Its level curves
 * are rings around the end; along a tube they follow each other at even distances. inside: one flag for each vertex of
 * the surface (patch.h); the end is one vertex or a connected piece. height: one value for each vertex. */
ORB_MUST_CHECK orb_status orb_map_limb_heights(orb_context *ctx, const orb_map_params *params, const orb_map_surface *b,
                                               const unsigned char *inside, double *height);

/* Moves a place along its ring by an angle, counterclockwise as seen from outside with the pole in the middle. Angles
 * are those of the conjugate of the height: the whole ring is 2π. All places of a ring keep their order, and so do the
 * rings. 0: the place is on no ring and stays. */
int orb_map_limb_rotate(const orb_map_surface *b, const double *height, double angle, orb_place *place);

#endif
