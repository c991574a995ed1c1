/* The level of all vertices. */
#ifndef ORB_ALIGN_MAP_ENGINE_FULL_LEVEL_H
#define ORB_ALIGN_MAP_ENGINE_FULL_LEVEL_H

#include "align/map/engine/run.h"

/* A level of all vertices at these points (mesh order), with the landmarks pinned. s: the order of the vertices; it
 * stays the caller's. */
ORB_MUST_CHECK orb_status orb_map_full_level(orb_map_run *run, const double *points, const orb_corner_table *s,
                                             orb_map_level *level);

#endif
