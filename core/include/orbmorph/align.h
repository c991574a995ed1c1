/* Alignment: embeddings of several shapes and their landmarks -> embeddings in which the landmarks coincide. */
#ifndef ORBMORPH_ALIGN_H
#define ORBMORPH_ALIGN_H

#include "orbmorph/alignment.h"

#ifdef __cplusplus
extern "C" {
#endif

ORB_API void orb_align_defaults(orb_align_options *options);

/* Aligns shape_count ≥ 1 shapes; the first keeps its place unless the method says otherwise. Every result is certified.
 *
 * - rotate: rotations only. With landmarks, by generalised Procrustes (Peng & Timalsena 2016, section 7.1); without, by
 *   a search over SO(3) for the rotation under which the map between the shapes is nearest to a rigid motion. Where
 *   landmarks leave the rotation around an axis open (one or two landmarks, or all on one axis), the search finds it.
 *   The same holds in pin and rbf.
 * - rbf: after the rotations, the warp of the paper (section 7.2), in rbf_steps steps a pass, to the spherical means;
 *   one_way: to the first shape's points. The influence of a landmark ends at its radius (0: rbf_radius; if that is 0:
 *   1.0). A step that folds is untangled locally; else it is halved; else the sphere is relaxed before it. Landmarks
 *   that cross on their way are carried over as in pin.
 * - pin: embeds the shapes anew with the landmarks as constraints, which meet at their spherical means. Landmarks that
 *   would have to pass through one another meet on surfaces with more edges, at the first shape's points or at new
 *   ones. After pin and rbf the vertices of a landmark have bit-equal points on all shapes.
 * - auto: pin with landmarks, else the rotation search followed by non-rigid registration. Where the map then has an
 *   energy above 1.05, other candidates are tried on coarse copies: further rotations, and tip maps. The best one is
 *   composed in full and returned if it lowers the energy. The preset fast skips all but the rotation search. `found`
 *   shows what was matched.
 *
 * Landmarks at the same place on every shape are merged: they share a vertex. Errors: ORB_E_BAD_LANDMARKS names
 * landmarks that are out of range or share a place on some shapes only; of a set that cannot be met, it names the first
 * that cannot be met together with those before it. ORB_E_BAD_OPTION: pin or rbf without landmarks. About O(n log n) in
 * triangles. Random landmarks that are far apart cost much more than similar ones, up to a bound: a set that needs more
 * than about a minute of work is refused as one that cannot be met. */
ORB_API ORB_MUST_CHECK orb_status orb_align(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                            const orb_landmark *landmarks, int32_t landmark_count,
                                            const orb_align_options *options, orb_alignment *out);

#ifdef __cplusplus
}
#endif
#endif
