/* First maps for the starts of a composed map: where each vertex of the moving shape goes on the fixed one.
 *
 * In: a run (engine/run.h) with both shapes and their landmarks. Out: its pairs, its spatial targets, and levels with
 * their vertices placed. Read in this order:
 *
 *   mirror.h         mirror landmarks
 *   spectral_samples.h  samples that correspond by eigenfunctions
 *   registration.h   spatial targets by non-rigid registration
 *   smooth.h         where noisy places are a map
 *   place.h          their places on the fixed shape, and the vertices of a level at them
 *   landmark_walk.h  a map in which all pairs meet
 */
#ifndef ORB_ALIGN_MAP_STARTS_PLACE_H
#define ORB_ALIGN_MAP_STARTS_PLACE_H

#include "align/map/engine/run.h"

/* Sets the spatial targets: from the pairs and `samples` samples of the best map or of the given targets, with the
 * normals of the registered shape, and with the nearest places on the fixed shape. */
ORB_MUST_CHECK orb_status orb_map_register(orb_map_run *run, int samples);

/* Puts the vertices of a level where the start has them; on spheres that keep angles, smoothed. to_mesh: of the
 * surface's vertices. */
ORB_MUST_CHECK orb_status orb_map_place(orb_map_run *run, orb_map_level *level, const int32_t *to_mesh,
                                        orb_map_start start);

#endif
