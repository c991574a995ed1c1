/* Alignment: embeddings of several shapes and their landmarks -> embeddings in which the landmarks coincide. */
#ifndef ORBMORPH_ALIGN_H
#define ORBMORPH_ALIGN_H

#include "orbmorph/alignment.h"

#ifdef __cplusplus
extern "C" {
#endif

ORB_API void orb_align_defaults(orb_align_options *options);

/* Aligns shape_count ≥ 1 shapes. The points of the first shape stay as they are unless the method says otherwise. Every
 * result is certified. pin and auto may change those of both of two shapes.
 *
 * - rotate: rotations only. With landmarks, generalised Procrustes (Peng & Timalsena 2016, section 7.1) gives them.
 *   Without, a search over SO(3) finds the rotation under which the map between the shapes is nearest to a rigid
 *   motion. If landmarks leave the rotation around an axis open (one or two landmarks, or all on one axis), the search
 *   finds it. The same holds for pin and rbf.
 * - rbf: after the rotations, the warp of the paper (section 7.2), in rbf_steps steps a pass, to the spherical means;
 *   with one_way, to the first shape's points. The influence of a landmark ends at its radius. A step that folds is
 *   untangled locally. If that fails, the step is halved several times. If that fails too, the sphere is relaxed before
 *   the step. Landmarks that still cannot pass each other meet as in pin, where edges are split.
 * - pin: embeds the shapes again with the landmarks as constraints, which meet at their spherical means. If landmarks
 *   would have to pass through one another, pin splits edges, and the landmarks meet at the first shape's points or at
 *   new ones. With any preset but fast, if four landmarks or more show that the shapes are one body in several poses
 *   and matching them leads to a good map, nothing is embedded with constraints: the landmarks meet at the first
 *   shape's points, and max_growth has no effect. If one of two shapes is a part of the other one, as a head is of a
 *   bust, and up to sixteen landmarks agree with that, what lies on each other in space is held beside them. After pin
 * and rbf the vertices of a landmark have bit-equal points on all shapes.
 * - auto: pin if there are landmarks. Without landmarks, auto first searches for rotations, then matches each later
 *   shape with the first: it tries spectral maps and rotations, and keeps the one that bends coarse copies of both
 *   shapes least. The composed map sends each vertex to where the match takes it. The preset fast only searches for
 *   rotations. `found` shows what was matched.
 *
 * Of two shapes, pin and auto choose which one counts as the first here, mostly the less round one, which has less
 * volume at the same area: both orders have the same map. Two with holes are taken as given.
 *
 * Landmarks at the same place on every shape are merged: they share a vertex. Errors: ORB_E_BAD_LANDMARKS names
 * landmarks that are out of range or share a place on some shapes only. If the landmarks cannot all be met, it names
 * the first one that conflicts with those before it. ORB_E_BAD_OPTION: pin or rbf without landmarks.
 *
 * Takes about O(n log n) in triangles. Landmarks at unrelated places of the shapes cost much more than landmarks that
 * roughly correspond. A set of landmarks that needs more than about a minute of work is refused as one that cannot be
 * met. */
ORB_API ORB_MUST_CHECK orb_status orb_align(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                            const orb_landmark *landmarks, int32_t landmark_count,
                                            const orb_align_options *options, orb_alignment *out);

/* Aligns shapes again after landmarks were moved, added or removed. Begins where another alignment of the same shapes,
 * in the same order, has ended, so limbs stay where it has them, and nothing is searched: for two shapes of 3,000
 * vertices that takes a third to a thirtieth of the time. start: of orb_align() or of this function, by any method.
 * Usually its found landmarks are corrected and given here. The preset fast makes the same map as the default one.
 *
 * out->has_followed 1: the map follows the start. 0: it could not, since the landmarks lead far away from it or have no
 * room on its spheres; the shapes were then aligned by orb_align(). Errors are those of orb_align(). ORB_E_BAD_OPTION
 * also: a start of other shapes, no landmarks, one shape, or another method than pin or auto. About linear in
 * triangles. */
ORB_API ORB_MUST_CHECK orb_status orb_align_again(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                                  const orb_landmark *landmarks, int32_t landmark_count,
                                                  const orb_align_options *options, const orb_alignment *start,
                                                  orb_alignment *out);

#ifdef __cplusplus
}
#endif
#endif
