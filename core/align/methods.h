/* Alignment: embeddings of several shapes and their landmarks -> embeddings in which the landmarks coincide and nearby
 * points of the surfaces correspond.
 *
 * Comes in: meshes with certified embeddings, and landmarks as places on the meshes. Goes out: an orb_alignment, whose
 * shapes share one sphere; each is certified. Read in this order; a file calls only files and folders before it:
 *
 *   sheet/   the working copy of a shape, which can be refined, and landmarks as its vertices
 *   rotate/  rotations of whole spheres, by landmarks or by search
 *   pin/     method `pin`: landmarks as constraints of the embeddings
 *   rbf/     method `rbf`: the warp of Peng & Timalsena 2016
 *   map/     the composed map, from one shape straight to the other, and its optimiser
 *   given.c  one method with the landmarks that are given, then the composed map
 *   find/    what can be matched where no landmarks are given
 *   auto.c   method `auto`: given.c with what find/ proposes
 *   align.c  orb_align(): checks the request and chooses between given.c and auto.c
 */
#ifndef ORB_ALIGN_METHODS_H
#define ORB_ALIGN_METHODS_H

#include "align/map/compose.h"

/* orb_align() without what `auto` does beyond it: the rotation search, and what was found. */
ORB_MUST_CHECK orb_status orb_align_given(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                          const orb_landmark *landmarks, int32_t landmark_count,
                                          const orb_align_options *options, orb_alignment *out);

/* Improves the maps from the first shape to the others, see orb_compose(), and fills alignment->energy. */
ORB_MUST_CHECK orb_status orb_compose_all(orb_context *ctx, orb_alignment *alignment, orb_map_from from,
                                          orb_preset preset);

/* Method `auto` without landmarks, see auto.c. */
ORB_MUST_CHECK orb_status orb_align_auto(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                         const orb_align_options *options, orb_alignment *out);

#endif
