/* The composed map: lowering the distortion of the map from one shape to another through the sphere, instead of that of
 * each shape's own embedding. compose.c describes the method.
 *
 * In: two aligned shapes, whose landmarks share points of the sphere. Out: new points of the moving shape, certified,
 * under which the map has less energy. Read in this order:
 *
 *   engine/   the optimiser: levels of the moving shape on the fixed one, and all parameters (engine/params.h)
 *   starts/   first maps: mirror landmarks, non-rigid registration, the landmark walk
 *   twist/    limbs that a map has twisted, and untwisting them
 *   swap.h    which of two shapes moves
 *   levels.h  from the first level of a start to all vertices
 *   start.h   one start, and passes of starts through samples of the best map
 *   targets.h the order of the starts where targets are given
 *   space/    the last steps: to where the shapes, or parts of them, fit each other in space (space/drawn.h)
 *   walked.h  the quick way: a landmark walk, optimised on a coarse level
 *   lifted.h  the map of a decimated copy, refined to all vertices
 *   whole.h   a run from its opening to its result
 *   draft.h   maps of which only the walks are made at first
 *   compose.c the order of the starts
 */
#ifndef ORB_ALIGN_MAP_COMPOSE_H
#define ORB_ALIGN_MAP_COMPOSE_H

#include "align/map/engine/guide.h"
#include "orbmorph/alignment.h"
#include "orbmorph/remesh.h"

/* Improves the points of `moving` on the sphere so that the map moving → sphere → fixed comes as near to an isometry as
 * possible. The landmarks (vertices of both shapes, whose points are already bit-equal) stay together. both: the fixed
 * shape's points may change too, which leaves more room, and the shapes may change places; else they stay as they are,
 * for further shapes. The result is certified and better than what was given, or fits parts of the shapes
 * (space/part.h) and may have more energy; otherwise all points stay as they are and *improved is 0. energy[2]:
 * symmetric Dirichlet energy of the composed map, capped at 20 for each triangle and weighted by area, before and
 * after. Stage "align". */
ORB_MUST_CHECK orb_status orb_compose(orb_context *ctx, orb_aligned_shape *fixed, orb_aligned_shape *moving, int both,
                                      int32_t landmark_count, const orb_map_guide *guide, orb_preset preset,
                                      double energy[2], int *improved);

/* The energy of the map as given. O(vertices) and a location for each. */
ORB_MUST_CHECK orb_status orb_compose_energy(orb_context *ctx, orb_aligned_shape *fixed, orb_aligned_shape *moving,
                                             orb_preset preset, double *energy);

#endif
