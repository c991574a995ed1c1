/* Which points of the rims correspond where each shape has one hole, without a map. */
#ifndef ORB_ALIGN_MAP_RIMS_ALONE_H
#define ORB_ALIGN_MAP_RIMS_ALONE_H

#include "align/map/engine/params.h"
#include "orbmorph/alignment.h"

enum { ORB_RIMS_ALONE = 12 }; /* points */

/* Places the points evenly along the only rims of two shapes, with the turn under which the rims fit best in space, or
 * that rotates the shape least where several fit: 2 places a point. *found 0: a shape has no or several holes. */
ORB_MUST_CHECK orb_status orb_rims_alone(orb_context *ctx, const orb_map_params *params,
                                         const orb_align_shape shapes[2], orb_place at[2 * ORB_RIMS_ALONE], int *found);

#endif
