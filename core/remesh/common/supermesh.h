/* A net as a supermesh. */
#ifndef ORB_REMESH_COMMON_SUPERMESH_H
#define ORB_REMESH_COMMON_SUPERMESH_H

#include "orbmorph/remesh.h"
#include "sphere/net.h"

/* Copies the live vertices and triangles to the supermesh's points and triangles (new arrays, the caller frees them),
 * in the same order. map (vertex_count numbers, may be NULL) receives the new number of each vertex, −1 for a dead one.
 */
ORB_MUST_CHECK orb_status orb_net_export(orb_context *ctx, const orb_net *net, orb_supermesh *out, int32_t *map);

#endif
