/* Levels of the moving shape, from the first of a start up to all vertices. */
#ifndef ORB_ALIGN_MAP_LEVELS_H
#define ORB_ALIGN_MAP_LEVELS_H

#include "align/map/engine/run.h"
#include "embed/newton/multires.h"
#include "embed/newton/refiner.h"

/* Makes run->hierarchy, on all of whose levels the vertices of pairs stay; the pairs meet in run->start. */
ORB_MUST_CHECK orb_status orb_map_levels_prepare(orb_map_run *run);

/* Makes a hierarchy run->hierarchy in which the vertices of pairs were kept; *hierarchy becomes NULL. */
void orb_map_levels_adopt(orb_map_run *run, orb_hierarchy **hierarchy);

/* A refiner of run->hierarchy, at its tetrahedron. */
ORB_MUST_CHECK orb_status orb_map_levels_begin(orb_map_run *run, orb_refiner **out);

/* The first level of a start, of at least `size` vertices (or all), with its vertices placed. */
ORB_MUST_CHECK orb_status orb_map_level_place(orb_map_run *run, orb_refiner *refiner, orb_map_start start, int32_t size,
                                              orb_map_level *level);

/* Writes a level back into the refiner, and its places into run->place. */
void orb_map_level_store(orb_map_run *run, const orb_map_level *level, orb_refiner *refiner);

/* Undoes collapses up to the next level. New vertices take some steps at once; with a pull, all vertices try their
 * spatial targets. known: room for a flag of each vertex. *has_room 0: crumples leave a vertex no room, and the refiner
 * and the level cannot be used any more. */
ORB_MUST_CHECK orb_status orb_map_level_next(orb_map_run *run, orb_refiner *refiner, orb_map_level *level,
                                             unsigned char *known, double pull, int *has_room);

/* Refines a level without flips up to all vertices. pull: to the spatial targets; it falls from level to level and ends
 * before the last. hold: what is left of it on every level, also on the last. rough: only so far that samples of the
 * map are useful. *failed: a level has flips, covers the sphere twice, or leaves a vertex no room. */
ORB_MUST_CHECK orb_status orb_map_levels_refine(orb_map_run *run, orb_refiner *refiner, orb_map_level *level,
                                                double pull, double hold, int rough, int *failed);

/* How a level is refined to all vertices. */
typedef struct orb_map_finish {
  double pull, hold; /* see orb_map_levels_refine() */
  int rough;         /* likewise */
  int irons;         /* 1: crumples of the result are ironed (engine/iron.h) */
} orb_map_finish;

/* Stores a level without flips, refines it, and keeps the result as run->best if it is better. */
ORB_MUST_CHECK orb_status orb_map_levels_finish(orb_map_run *run, orb_refiner *refiner, orb_map_level *level,
                                                const orb_map_finish *how);

#endif
