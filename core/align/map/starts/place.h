/* Where a start puts the vertices of its first level. */
#ifndef ORB_ALIGN_MAP_STARTS_PLACE_H
#define ORB_ALIGN_MAP_STARTS_PLACE_H

#include "align/map/engine/run.h"

/* compose_guess.c: spatial targets from the landmarks and so many samples of the best map, with the normals that the
 * bent shape has, and the nearest places to them. */
ORB_MUST_CHECK orb_status orb_map_register(orb_map_run *run, int samples);

/* Puts the vertices of a level where the start has them. to_mesh: of the surface's vertices. */
void orb_map_place(orb_map_run *run, orb_map_level *level, const int32_t *to_mesh, orb_map_start start);

#endif
