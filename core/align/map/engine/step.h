/* Steps that move a vertex of a level over the fixed shape. */
#ifndef ORB_ALIGN_MAP_ENGINE_STEP_H
#define ORB_ALIGN_MAP_ENGINE_STEP_H

#include "align/map/engine/level.h"

/* Returns how far the vertex moved. */
double orb_map_level_step(orb_map_level *level, const orb_map_surface *b, const orb_map_rules *rules, int32_t v);

/* Moves a vertex to a place if that lowers the energy of its star and flips nothing; returns whether it did. */
int orb_map_level_try(orb_map_level *level, const orb_map_surface *b, const orb_map_rules *rules, int32_t v,
                      const orb_place *place);

#endif
