/* The last steps of a map: it is drawn to where the two shapes fit each other in space.
 *
 * In: a run with a best map, and spatial targets. Out: another best map, which may have more energy, or the same. Read
 * in this order:
 *
 *   slide.h  shapes that fit as wholes
 *   part.h   shapes of which only parts fit, as the landmarks tell
 *   drawn.h  drawing all vertices, which both do
 */
#ifndef ORB_ALIGN_MAP_SPACE_DRAWN_H
#define ORB_ALIGN_MAP_SPACE_DRAWN_H

#include "align/map/engine/run.h"

/* Draws a level of all vertices to run->target, in rounds: as long as a round brings many of those left to theirs.
 * drawn: the vertices that are drawn, mesh order; NULL: all. to_mesh: of the surface's vertices. pull: its strength,
 * relative to the energy of a vertex's area. */
ORB_MUST_CHECK orb_status orb_map_draw_whole(orb_map_run *run, orb_map_level *level, const int32_t *to_mesh,
                                             const unsigned char *drawn, double pull);

/* Makes the level the best map, unless it has flips, covers the sphere more than once, or has an energy of `most` or
 * more. Returns whether it has. */
int orb_map_take_drawn(orb_map_run *run, const orb_map_level *level, const int32_t *to_mesh, double most);

#endif
