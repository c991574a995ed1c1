/* Rounds of sweeps over one level. */
#ifndef ORB_ALIGN_MAP_ENGINE_ROUNDS_H
#define ORB_ALIGN_MAP_ENGINE_ROUNDS_H

#include "align/map/engine/run.h"

/* Sweeps until hardly any vertex moves, `count` times at most. */
ORB_MUST_CHECK orb_status orb_map_sweeps(orb_map_run *run, orb_map_level *level, orb_map_rules rules, int count);

/* Rules of sweeps that allow flips against a barrier of this strength. */
orb_map_rules orb_map_soft(const orb_map_params *params, double barrier);
/* Rules of sweeps that allow no flip. */
orb_map_rules orb_map_hard(const orb_map_params *params);

/* Pulls every vertex of the level to its spatial target; strength 0: none. Springs pull in any case. */
void orb_map_set_pull(const orb_map_run *run, orb_map_level *level, const int32_t *to_mesh, double strength);
/* The same for the vertices that are drawn, mesh order; NULL: all. */
void orb_map_pull_drawn(const orb_map_run *run, orb_map_level *level, const int32_t *to_mesh, double strength,
                        const unsigned char *drawn);

/* The map of a level, to go back to. The density is not part of it: sweeps set it, single steps need
 * orb_map_level_refresh() first. */
typedef struct orb_map_copy {
  orb_place *place;
  double *y; /* y, n and x, as they lie in the level */
} orb_map_copy;

ORB_MUST_CHECK orb_status orb_map_copy_take(orb_map_run *run, const orb_map_level *level, orb_map_copy *out);

void orb_map_copy_restore(const orb_map_copy *copy, orb_map_level *level);
/* The same for one vertex. */
void orb_map_copy_restore_vertex(const orb_map_copy *copy, orb_map_level *level, int32_t v);

void orb_map_copy_free(orb_map_run *run, orb_map_copy *copy);

#endif
