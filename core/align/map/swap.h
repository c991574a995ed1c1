/* Which of two shapes moves. */
#ifndef ORB_ALIGN_MAP_SWAP_H
#define ORB_ALIGN_MAP_SWAP_H

#include "align/map/engine/params.h"
#include "orbmorph/alignment.h"

/* Should the shapes change places? The triangles of the shape that moves must be able to follow the other surface.
 * Where that has a limb for which the moving shape has hardly a triangle, the images of triangles are inverted. */
ORB_MUST_CHECK orb_status orb_map_should_swap(orb_context *ctx, const orb_map_params *params,
                                              const orb_aligned_shape *fixed, const orb_aligned_shape *moving,
                                              int *swap);

#endif
