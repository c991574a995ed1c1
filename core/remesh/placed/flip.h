/* Edge flips of a placed net. */
#ifndef ORB_REMESH_PLACED_FLIP_H
#define ORB_REMESH_PLACED_FLIP_H

#include "remesh/placed/placed_net.h"

/* Flips edge h and assigns the items of its two triangles again. Ask first whether it may be flipped. */
void orb_placed_flip(orb_placed_net *placed, int32_t h);

/* The greatest squared distance of the items in the two triangles of edge h = a→b to the triangles (c,d,b) and (d,c,a)
 * that a flip makes. */
double orb_placed_flip_items2(const orb_placed_net *placed, int32_t h);

/* Flips edge h if that improves the form of its triangles and keeps the limit (relative, squared). Returns whether it
 * did. */
int orb_placed_try_flip(orb_placed_net *placed, int32_t h, double limit2);

/* Tries every edge, in a few passes; only_bad: only the edges of triangles that are inverted or slivers. */
ORB_MUST_CHECK orb_status orb_placed_flip_all(orb_context *ctx, orb_placed_net *placed, double limit2, int only_bad);

#endif
