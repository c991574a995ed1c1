/* Holes of the shapes that fill_holes has filled. */
#ifndef ORB_TRANSFER_HOLES_H
#define ORB_TRANSFER_HOLES_H

#include "orbmorph/asset.h"

/* Assigns slivers on a rim to the side on which they lie. The three corners of such a triangle are on one edge of
 * the rim, so rounding decides where its centre is; a lone one on the wrong side would leave a gap, or a flap. home:
 * for each triangle of the supermesh the triangle of the first shape that holds its centre; that of a group of slivers
 * becomes that of a neighbour on their side. O(triangles). */
ORB_MUST_CHECK orb_status orb_holes_settle(orb_context *ctx, const orb_supermesh *supermesh, const orb_mesh *mesh,
                                           int32_t *home);

/* Counts the filled holes of the first shape that are open in the asset, and adds to the list what the asset lacks for
 * its holes: those of the first shape that stay filled, and what is open on the first shape or on a later one only, by
 * the alignment's matches of rims. is_file: the triangles of the asset are those of the first shape's file. */
ORB_MUST_CHECK orb_status orb_dropped_holes(orb_context *ctx, const orb_supermesh *supermesh,
                                            const orb_alignment *alignment, const orb_asset_options *options,
                                            int is_file, int32_t *open, orb_dropped **list, int32_t *count);

#endif
