/* Steps that move the vertices of a level over the fixed shape. */
#ifndef ORB_ALIGN_MAP_ENGINE_STEP_H
#define ORB_ALIGN_MAP_ENGINE_STEP_H

#include "align/map/engine/level.h"

/* One pass of damped Newton steps over all vertices that are not pinned, colour by colour. *moved: the mean length;
 * *stepped: the number of vertices that did not wait. */
ORB_MUST_CHECK orb_status orb_map_level_sweep(orb_context *ctx, orb_map_level *level, const orb_map_surface *b,
                                              const orb_map_rules *rules, double *moved, int32_t *stepped);

/* The step of one vertex. */
void orb_map_level_step(orb_map_level *level, const orb_map_surface *b, const orb_map_rules *rules, int32_t v);

/* Moves a vertex to a place if that lowers the energy of its star and flips nothing; returns whether it did. */
int orb_map_level_try(orb_map_level *level, const orb_map_surface *b, const orb_map_rules *rules, int32_t v,
                      const orb_place *place);

#endif
