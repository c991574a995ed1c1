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
 *   slide.h   the last step there on spheres that keep angles, and of a walk to a good map
 *   walked.h  the quick way: a landmark walk, optimised on a coarse level
 *   lifted.h  the map of a decimated copy, refined to all vertices
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
 * for further shapes. The result is certified and better than what was given; otherwise all points stay as they are and
 * *improved is 0. energy[2]: symmetric Dirichlet energy of the composed map, capped at 20 for each triangle and
 * weighted by area, before and after. Stage "align". */
ORB_MUST_CHECK orb_status orb_compose(orb_context *ctx, orb_aligned_shape *fixed, orb_aligned_shape *moving, int both,
                                      int32_t landmark_count, const orb_map_guide *guide, orb_preset preset,
                                      double energy[2], int *improved);

/* A map of two shapes towards spatial targets of which only the landmark walks are made, on a coarse level. Several
 * drafts of the same shapes may be made side by side, and the best one finished. */
typedef struct orb_map_draft orb_map_draft;

/* As orb_compose() with a target, `both` and walks_first, without landmarks, on spheres that keep angles, up to the
 * walks. target: NULL for what fits best in space. known: the energy of the best walk of other drafts, or INFINITY;
 * with it, fewer walks are tried. *energy: that of the best walk; INFINITY if none leads to a map. The shapes stay as
 * they are, and must until orb_map_draft_take() or orb_map_draft_free(), as must the target. Free the draft in any
 * case. */
ORB_MUST_CHECK orb_status orb_map_draft_create(orb_context *ctx, orb_aligned_shape *fixed, orb_aligned_shape *moving,
                                               const double *target, double known, orb_preset preset,
                                               orb_map_draft **out, double *energy);
/* Makes the map of a draft with all vertices, once, on any context of the same root. *energy: of the map, or that of
 * the shapes as they are if it is no better. The shapes stay as they are. */
ORB_MUST_CHECK orb_status orb_map_draft_finish(orb_context *ctx, orb_map_draft *draft, double *energy);
/* Slides a finished draft where that may help, and writes its map to the shapes, as orb_compose() does. No limb is
 * untwisted: of 46 pairs of unlike shapes that lowered the energy of one, by 0.005, for a tenth of the time of all.
 * *energy: of the map afterwards. */
ORB_MUST_CHECK orb_status orb_map_draft_take(orb_context *ctx, orb_map_draft *draft, double *energy);
void orb_map_draft_free(orb_context *ctx, orb_map_draft *draft);

/* The energy of the map as given. O(vertices) and a location for each. */
ORB_MUST_CHECK orb_status orb_compose_energy(orb_context *ctx, orb_aligned_shape *fixed, orb_aligned_shape *moving,
                                             orb_preset preset, double *energy);

#endif
