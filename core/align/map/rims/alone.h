/* Which points of the rims correspond where each shape has one hole, without a map. */
#ifndef ORB_ALIGN_MAP_RIMS_ALONE_H
#define ORB_ALIGN_MAP_RIMS_ALONE_H

#include "align/map/engine/params.h"
#include "orbmorph/alignment.h"

enum { ORB_RIMS_ALONE = 12 }; /* points: enough to show the shift, and few enough to leave the map free */

/* Places the points evenly along the only rims of two shapes, shifted so that the rims fit best in space. Where
 * several shifts fit, the one that rotates the shape least wins. 2 places a point. *found 0: a shape does not have
 * exactly one hole, or its rim is not simple. */
ORB_MUST_CHECK orb_status orb_rims_alone(orb_context *ctx, const orb_map_params *params,
                                         const orb_align_shape shapes[2], orb_place at[2 * ORB_RIMS_ALONE], int *found);

#endif
