/* Handing a net over as a supermesh. */
#ifndef ORB_REMESH_NET_EXPORT_H
#define ORB_REMESH_NET_EXPORT_H

#include "orbmorph/remesh.h"
#include "sphere/net.h"

/* Hands the live part over as a supermesh's triangles and points (arrays of the caller), numbering kept where all
 * live; map (vertex_count, may be NULL) gets the new numbers. */
ORB_MUST_CHECK orb_status orb_net_export(orb_context *ctx, const orb_net *net, orb_supermesh *out, int32_t *map);

#endif
