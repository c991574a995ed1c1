/* Delaunay edge flips over a whole net. */
#ifndef ORB_SPHERE_DELAUNAY_H
#define ORB_SPHERE_DELAUNAY_H

#include "sphere/net.h"

/* Flips edges until all are Delaunay (empty circles on the sphere) up to rounding. */
ORB_MUST_CHECK orb_status orb_net_delaunay(orb_context *ctx, orb_net *net);

#endif
