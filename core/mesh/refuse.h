/* Refusals of a mesh, with the facts that let its owner find the spot. */
#ifndef ORB_MESH_REFUSE_H
#define ORB_MESH_REFUSE_H

#include "mesh/surface.h"

orb_status orb_refuse_crowded(orb_surface *surface);
orb_status orb_refuse_facing(orb_surface *surface);
orb_status orb_refuse_open(orb_surface *surface);
orb_status orb_refuse_pinched(orb_surface *surface, const orb_fans *fans);
orb_status orb_refuse_pieces(orb_surface *surface);
orb_status orb_refuse_handles(orb_surface *surface, int64_t genus);
orb_status orb_refuse_few(orb_surface *surface);

/* Fails with ORB_E_DEGENERATE where float32 could not show the mesh: tiny, or far from the origin. O(V). */
ORB_MUST_CHECK orb_status orb_refuse_size(orb_context *ctx, const orb_mesh *mesh);

/* The half-edges whose twin is `kind`, as (larger vertex << 32 | half-edge), by smaller vertex and then that. start:
 * vertex_count + 2 zeros; either may be NULL, which is ORB_E_NO_MEMORY. */
ORB_MUST_CHECK orb_status orb_refuse_sort_edges(const orb_surface *surface, int32_t kind, uint64_t *entry,
                                                int32_t *start);

#endif
