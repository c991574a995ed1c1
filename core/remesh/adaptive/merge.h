/* Merging neighbours to one vertex. */
#ifndef ORB_REMESH_ADAPTIVE_MERGE_H
#define ORB_REMESH_ADAPTIVE_MERGE_H

#include "remesh/placed/placed_net.h"

/* Merges neighbours wherever the limit (relative, squared) allows it, while more than `target` triangles live. quick:
 * tries less, which takes half the time and leaves a few per cent more triangles. */
ORB_MUST_CHECK orb_status orb_adaptive_merge_all(orb_context *ctx, orb_placed_net *placed, double limit2,
                                                 int64_t target, int quick);

#endif
