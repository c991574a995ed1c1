/* The errors that refuse a mesh. Each function sets the error record, with the edges, vertices or pieces that
 * let the owner find the spot in the file, and returns its status. */
#ifndef ORB_MESH_REFUSE_H
#define ORB_MESH_REFUSE_H

#include "mesh/parts.h"

/* was_split: nonzero if orb_surface_split() has left these edges. */
orb_status orb_refuse_crowded(orb_surface *surface, unsigned was_split);
orb_status orb_refuse_facing(orb_surface *surface);
orb_status orb_refuse_open(orb_surface *surface);
orb_status orb_refuse_pinched(orb_surface *surface, const orb_fans *fans);
orb_status orb_refuse_pieces(orb_surface *surface);
/* With a loop for each handle; changes the surface. limit: the longest loop that close_handles was allowed to cut
 * along, relative to the diagonal; 0: the repair was not allowed. */
orb_status orb_refuse_handles(orb_surface *surface, int64_t genus, double limit);
/* ORB_E_NOT_CONNECTED with a list of the parts; ORB_E_BAD_OPTION if the mesh is one piece. */
orb_status orb_refuse_part(orb_surface *surface, const orb_parts *parts, const orb_repair_options *options);
orb_status orb_refuse_few(orb_surface *surface);

/* Fails with ORB_E_DEGENERATE where float32 cannot hold the mesh: tiny, or far from the origin. O(V). */
ORB_MUST_CHECK orb_status orb_refuse_size(orb_context *ctx, const orb_mesh *mesh);

/* Lists the half-edges whose twin is `kind` as (larger vertex << 32 | half-edge), sorted by smaller vertex and then by
 * that number. start: vertex_count + 2 zeros. Returns ORB_E_NO_MEMORY if entry or start is NULL. */
ORB_MUST_CHECK orb_status orb_refuse_sort_edges(const orb_surface *surface, int32_t kind, uint64_t *entry,
                                                int32_t *start);

#endif
