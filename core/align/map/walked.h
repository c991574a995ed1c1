/* The quick way to a map: a landmark walk, optimised on a coarse level and then refined to all vertices. */
#ifndef ORB_ALIGN_MAP_WALKED_H
#define ORB_ALIGN_MAP_WALKED_H

#include "align/map/levels.h"

/* A map on a coarse level of the moving shape. It has a sphere of the fixed shape and a hierarchy of its own, which the
 * run has only while it works on this map. */
typedef struct orb_map_walked {
  orb_hierarchy *hierarchy; /* NULL: the run has it */
  orb_refiner *refiner;
  orb_map_level level;
  double *fixed; /* points of the fixed shape, 3 per vertex */
  double hold;   /* strength of the pull to the spatial targets that guided it; 0: nothing has guided it */
  double energy; /* without the pull. INFINITY: there is no map, or it is hopeless */
} orb_map_walked;

/* Walks, and optimises the levels up to the coarse one, which is loosened only without guides. guides: samples of the
 * spatial targets that walk with the pairs, and are free afterwards; then all targets pull (params.walked.hold). Only a
 * map without guides can be hopeless by its energy. Afterwards the run is as it was. Free `out` in any case. */
ORB_MUST_CHECK orb_status orb_map_walked_create(orb_map_run *run, int32_t guides, orb_map_walked *out);
/* Walks with different numbers of guides. The map of least energy replaces `best` if it is better, and is then
 * loosened, unless its energy is above params.walked.lost. */
ORB_MUST_CHECK orb_status orb_map_walked_improve(orb_map_run *run, orb_map_walked *best);
void orb_map_walked_free(orb_map_run *run, orb_map_walked *walked);

/* Refines to all vertices, and the spatial targets still pull; the result becomes the best map if it is better. If a
 * level has flips, its energy is INFINITY. Otherwise `walked` is used up. */
ORB_MUST_CHECK orb_status orb_map_walked_refine(orb_map_run *run, orb_map_walked *walked);

#endif
