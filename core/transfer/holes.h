/* Holes of the shapes that fill_holes has filled. */
#ifndef ORB_TRANSFER_HOLES_H
#define ORB_TRANSFER_HOLES_H

#include "orbmorph/asset.h"

/* Whether fill_holes has filled a hole of the mesh. O(triangles). */
int orb_has_holes(const orb_mesh *mesh);

/* Adds to the list what the asset lacks for its holes: those of the first shape that stay filled, and what is open on
 * the first shape or on a later one only. is_file: the triangles of the asset are those of the first shape's file. */
ORB_MUST_CHECK orb_status orb_dropped_holes(orb_context *ctx, const orb_supermesh *supermesh,
                                            const orb_aligned_shape *shapes, const orb_asset_options *options,
                                            int is_file, orb_dropped **list, int32_t *count);

#endif
