/* Rims of filled holes that correspond.
 *
 * The asset omits the triangles that fill a hole of the first shape, and so it omits whatever surface of a later shape
 * lies there. If a later shape has the same hole, the two rims must meet. Otherwise the asset loses a strip of that
 * shape's surface, or shows a strip of what fills its hole.
 *
 * In: an alignment. Out: the same, in which the rims of holes that correspond lie on each other. Read in
 * this order:
 *
 *   side.h   one of the two shapes, its holes, and where the map takes their rims
 *   pair.h   which holes correspond
 *   along.h  which points of two rims correspond
 *   rims.c   the map composed again, with these points held
 *   alone.h  which points correspond without a map
 */
#ifndef ORB_ALIGN_MAP_RIMS_RIMS_H
#define ORB_ALIGN_MAP_RIMS_RIMS_H

#include "orbmorph/align.h"

/* Finds the holes of the later shapes that correspond to holes of the first one, makes the points of their rims
 * landmarks of their own, beside those of the alignment, and composes the map to each such shape again, from where the
 * alignment takes it. Fills out->rims, and sets out->energy. A shape for which that gives no map stays as it is.
 * Nothing happens unless two shapes have filled holes. */
ORB_MUST_CHECK orb_status orb_align_rims(orb_context *ctx, const orb_align_options *options, orb_alignment *out);

#endif
