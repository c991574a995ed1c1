/* Moves of net vertices on the sphere. */
#ifndef ORB_REMESH_ADAPTIVE_MOVE_H
#define ORB_REMESH_ADAPTIVE_MOVE_H

#include "remesh/placed/placed_net.h"

/* Moves every vertex to where its triangles have better forms or its edges deviate less, within limit2 (relative,
 * squared). which: a byte a vertex, 0 where it must stay; NULL: all may move. */
ORB_MUST_CHECK orb_status orb_adaptive_move_all(orb_context *ctx, orb_placed_net *placed, double limit2,
                                                const unsigned char *which);

#endif
