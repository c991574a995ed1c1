/* Closing handles, and showing those that stay. */
#ifndef ORB_MESH_HANDLES_H
#define ORB_MESH_HANDLES_H

#include "mesh/surface.h"

/* Loops in the file's vertices. */
typedef struct orb_loops {
  orb_handle *loop;
  int32_t *vertices;
  int32_t count, vertex_count, room, vertex_room;
} orb_loops;
void orb_loops_free(orb_context *ctx, orb_loops *loops);

/* Cuts a closed surface of this genus, whose vertices have one fan each, along loops of up to `size` times the
 * diagonal, shortest first, and covers both rims of each cut, until it has no handles or none that small. Adds to the
 * mesh's handles; *genus: what is left. Searches settle 256 vertices for each triangle and a million more at most:
 * ORB_E_TOO_LARGE. */
ORB_MUST_CHECK orb_status orb_surface_close_handles(orb_surface *surface, double size, int64_t *genus);

/* Finds a loop for each handle: closed, each vertex once, along edges of the file, and such that a cut along it leaves
 * the surface connected, which proves that it is not contractible. A handle has none only if no round finds one that
 * names each vertex once. O(F log F) for each round. Cuts the surface, which the caller can only free afterwards. */
ORB_MUST_CHECK orb_status orb_surface_list_handles(orb_surface *surface, int64_t genus, orb_loops *out);

#endif
