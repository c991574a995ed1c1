/* The rotation of a map from ring to ring along a limb. */
#ifndef ORB_ALIGN_MAP_TWIST_BANDS_H
#define ORB_ALIGN_MAP_TWIST_BANDS_H

#include "align/map/engine/params.h"
#include "align/map/twist/patch.h"

/* A twisted limb: how far the map has rotated it around its axis, by the height above its root (limb.h), in radians.
 * Positive: counterclockwise as seen from outside with the tip in the middle. */
typedef struct orb_map_twist {
  int32_t pole; /* the tip, a vertex of the surface; −1: the end of the limb is held, and it is wound by whole turns */
  int count;
  double height[ORB_MAP_BANDS + 1], angle[ORB_MAP_BANDS + 1];
  double most; /* the greatest angle, without sign */
} orb_map_twist;

/* Sums up the rotation from the limb's rim to each of its bands, rings of vertices of similar height: out->height,
 * angle and count, which is 0 where there are too few vertices. back: where the surface's vertices come from. Bands end
 * at the end of the limb. patch: with `reached` set; its rings are
 * overwritten. O(n log n). */
ORB_MUST_CHECK orb_status orb_map_bands_measure(const orb_map_params *params, orb_map_patch *patch,
                                                const double *height, const double *back, orb_map_twist *out);

#endif
