/* Removing vertices by edge collapses in order of quadric error. */
#ifndef ORB_REMESH_ADAPTIVE_COLLAPSE_H
#define ORB_REMESH_ADAPTIVE_COLLAPSE_H

#include "remesh/placed/placed_net.h"

/* Collapses edges while every matched distance stays within the limit (relative, squared) and more than `target`
 * triangles live. strict: also prevents inverted triangles and slivers. thorough: where no edge of a vertex can be
 * collapsed, tries all ways to fill the hole that the vertex leaves. */
ORB_MUST_CHECK orb_status orb_adaptive_collapse(orb_context *ctx, orb_placed_net *placed, double limit2, int64_t target,
                                                int strict, int thorough);

#endif
