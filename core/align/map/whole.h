/* A run of the composed map from its opening to its result: what compose.c and draft.c share. */
#ifndef ORB_ALIGN_MAP_WHOLE_H
#define ORB_ALIGN_MAP_WHOLE_H

#include "align/map/engine/run.h"

/* A run of these two shapes, which it borrows. Nothing is allocated yet. */
orb_map_run orb_map_run_of(orb_context *ctx, orb_aligned_shape *fixed, orb_aligned_shape *moving, int both,
                           int32_t landmark_count, const orb_map_guide *guide, orb_preset preset);
void orb_map_run_free(orb_map_run *run);

/* Allocates what a run holds but for the packed surface, and scales both shapes. Free the run in any case. O(n log n).
 */
ORB_MUST_CHECK orb_status orb_map_run_prepare(orb_map_run *run);
/* The same, packs the surface, measures the map as given, finds the pairs and fills the target that the guide aims at.
 * energy: as of orb_compose(), both of the map as given. */
ORB_MUST_CHECK orb_status orb_map_run_open(orb_map_run *run, const orb_map_guide *guide, double energy[2]);

/* Is the map so bad that no last step is worth its time? */
int orb_map_run_is_hopeless(const orb_map_run *run);
/* Draws the map to where parts of the shapes fit in space, or slides where that may help. before: the energy of the map
 * as given. */
ORB_MUST_CHECK orb_status orb_map_run_fit(orb_map_run *run, orb_map_from from, double before);
/* Writes the best map back if it is better than the alignment as given, or fits parts, and is certified. energy: as of
 * orb_compose(). */
ORB_MUST_CHECK orb_status orb_map_run_take(orb_map_run *run, orb_aligned_shape *fixed, double energy[2], int *improved);

#endif
