/* The result of a method that works on a placed net. */
#ifndef ORB_REMESH_PLACED_EXPORT_H
#define ORB_REMESH_PLACED_EXPORT_H

#include "remesh/placed/placed_net.h"

/* Fills points, triangles, places and error bounds of `out` from the live part of the net. */
ORB_MUST_CHECK orb_status orb_placed_export(orb_context *ctx, const orb_placed_net *placed, orb_supermesh *out);

#endif
