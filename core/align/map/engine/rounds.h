/* Rounds of sweeps over one level. */
#ifndef ORB_ALIGN_MAP_ENGINE_ROUNDS_H
#define ORB_ALIGN_MAP_ENGINE_ROUNDS_H

#include "align/map/engine/run.h"

/* compose_rounds.c. Sweeps until hardly a vertex moves any more, `count` at most. */
ORB_MUST_CHECK orb_status orb_map_sweeps(orb_map_run *run, orb_map_level *level, orb_map_rules rules, int count);

/* Rules of sweeps: flips allowed against a barrier of that strength, or none. */
orb_map_rules orb_map_soft(double barrier);

orb_map_rules orb_map_hard(void);

void orb_map_set_pull(const orb_map_run *run, orb_map_level *level, const int32_t *to_mesh, double strength);

/* What a level holds of its map, to go back to. Sweeps set the density anew; single steps need it refreshed. */
typedef struct orb_map_copy {
  orb_place *place;
  double *y; /* y, n and x, as they lie in the level */
} orb_map_copy;

ORB_MUST_CHECK orb_status orb_map_copy_take(orb_map_run *run, const orb_map_level *level, orb_map_copy *out);

void orb_map_copy_restore(const orb_map_copy *copy, orb_map_level *level);

void orb_map_copy_free(orb_map_run *run, orb_map_copy *copy);

/* Flips are driven out: sweeps against a growing barrier, then untangling of a copy, until that succeeds. */
ORB_MUST_CHECK orb_status orb_map_clear_flips(orb_map_run *run, orb_map_level *level, int rounds, int32_t *flips);

/* Vertices that barriers have locked in get free where flips are allowed for a while. What comes of it is kept if it
 * can be untangled and is better. */
ORB_MUST_CHECK orb_status orb_map_loosen(orb_map_run *run, orb_map_level *level, int soft_sweeps, int hard_sweeps);

/* Draws a level without flips to its spatial targets, round by round less strongly. */
ORB_MUST_CHECK orb_status orb_map_draw(orb_map_run *run, orb_map_level *level, const int32_t *to_mesh);

#endif
