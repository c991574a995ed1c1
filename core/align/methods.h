/* Alignment: embeddings of several shapes and their landmarks -> embeddings in which the landmarks coincide and nearby
 * points of the surfaces correspond.
 *
 * In: meshes with certified embeddings, and landmarks as places on the meshes. Out: an orb_alignment, whose shapes
 * share one sphere and are all certified. docs/method.md describes the methods and docs/glossary.md the terms. Read in
 * this order; a file calls only files and folders before it:
 *
 *   sheet/   the working copy of a shape, which can be refined, and landmarks as its vertices
 *   rotate/  method `rotate`: rotations of whole spheres, by landmarks or by search
 *   pin/     method `pin`: landmarks as constraints of the embeddings
 *   rbf/     method `rbf`: the warp of Peng & Timalsena 2016
 *   map/     the composed map, from one shape through the sphere to the other, and its optimiser; map/rims/: rims of
 *            filled holes that correspond, which lie on each other afterwards
 *   find/    matches, without landmarks or in agreement with them; given landmarks that may be misplaced
 *            (find/suspects.h)
 *   given/   method.c: one method with the given landmarks, and the composed maps of an alignment; part.c: landmarks
 *            that hold a part of the other shape; by_landmarks.c: a part, or two ways to align by landmarks, of which
 *            the better one wins; given.c: one of these, then soft landmarks are released, and copies are extended to
 *            their shapes; again.c: from an earlier alignment, after landmarks have changed
 *   auto/    auto.c: method `auto`, the rotation search, composed towards the matches of find/; held.c: pairs of a
 *            match, held like landmarks
 *   align.c  orb_align(): checks the request, chooses between given/ and auto/, and aligns copies of large shapes
 *
 * The main header of each folder says what comes in, what goes out, and in which order to read its files:
 * sheet/sheet.h, rotate/rotate.h, pin/pin.h, rbf/rbf.h, map/compose.h, map/rims/rims.h, find/match.h.
 */
#ifndef ORB_ALIGN_METHODS_H
#define ORB_ALIGN_METHODS_H

#include "align/map/compose.h"
#include "align/sheet/copies.h"
#include "base/tasks.h"

/* Are maps composed after the method? */
static inline int orb_align_composes(const orb_align_options *options) {
  return options->preset != ORB_PRESET_FAST && (options->method == ORB_ALIGN_PIN || options->method == ORB_ALIGN_AUTO);
}

/* Working copies with the landmarks as vertices, aligned by options->method and certified; no map is composed. */
ORB_MUST_CHECK orb_status orb_align_by_method(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                              const orb_landmark *landmarks, int32_t landmark_count,
                                              const orb_align_options *options, orb_alignment *out);

/* Working copies in which the landmarks meet, by pins or by a match, with their maps composed. Soft landmarks are held
 * like the others. If one of two shapes is found to be a part of the other one, `out` has more landmarks than were
 * given: what is held for the part comes after them, until the caller forgets it
 * (orb_alignment_forget_landmarks()). */
ORB_MUST_CHECK orb_status orb_align_by_landmarks(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                                 const orb_landmark *landmarks, int32_t landmark_count,
                                                 const orb_align_options *options, orb_alignment *out);

/* orb_align() for one method with the given landmarks; `auto` without landmarks is the rotation search here. `out` may
 * have more landmarks, as above. */
ORB_MUST_CHECK orb_status orb_align_given(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                          const orb_landmark *landmarks, int32_t landmark_count,
                                          const orb_align_options *options, orb_alignment *out);

/* Soft landmarks say where to look, not where to end. They were pinned with the others, so that the map takes each limb
 * to its limb. Now the map is composed once more with them free, and a spring pulls the places of each together. What
 * is held for a part, after these landmarks, stays held. */
ORB_MUST_CHECK orb_status orb_align_soften(orb_context *ctx, const orb_landmark *landmarks, int32_t count,
                                           orb_preset preset, orb_alignment *alignment);

/* Aligns from where another alignment of these shapes has ended (given/again.c). *followed 0: the landmarks lead far
 * away from it, or have no room on its spheres; `out` is then empty. */
ORB_MUST_CHECK orb_status orb_align_follow(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                           const orb_landmark *landmarks, int32_t landmark_count,
                                           const orb_align_options *options, const orb_alignment *start,
                                           orb_alignment *out, int *followed);

/* The same with `pin`, for pairs of a match that has led to no good map: tries neither a landmark walk alone nor the
 * match again. */
ORB_MUST_CHECK orb_status orb_align_pinned(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                           const orb_landmark *landmarks, int32_t landmark_count,
                                           const orb_align_options *options, orb_alignment *out);

/* Vertices that correspond: pair k is vertex[s · stride + k] of every shape s. */
typedef struct orb_held_pairs {
  const int32_t *vertex;
  int32_t stride, count;
} orb_held_pairs;

/* Aligns shapes by pairs of vertices, and composes their maps. for_good: the pairs are held like given landmarks, and
 * are the landmarks of the alignment until the caller forgets them; otherwise they are pinned, and let go once a map is
 * found. No mesh is split. *held 0: the pairs cannot be met, and `out` is empty. */
ORB_MUST_CHECK orb_status orb_align_held(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                         const orb_held_pairs *pairs, int for_good, const orb_align_options *options,
                                         orb_alignment *out, int *held);

/* What the maps of all later shapes should reach. */
typedef struct orb_aims {
  const double *const *targets; /* NULL, or for each shape but the first what orb_compose() takes */
  orb_map_aim aim;              /* of two shapes: see orb_map_guide */
  int keep_angles;              /* the spheres of the shapes do */
  orb_map_beat beat;            /* see orb_map_guide */
  orb_map_course *course;       /* of two shapes: see orb_map_guide */
  int walks_first, walks_early; /* see orb_map_guide */
} orb_aims;

/* Runs tasks that each make the map of a further shape to the first one (base/tasks.h): side by side if the first one
 * is small, else one after the other, since each map has a copy of it, and loops over a large shape use all threads. */
ORB_MUST_CHECK orb_status orb_align_each(orb_context *ctx, const orb_aligned_shape *first, orb_preset preset,
                                         int32_t count, orb_task_fn task, void *arg);

/* Improves the maps from the first shape to the others (orb_compose()), with orb_align_each(), since aligned landmarks
 * alone do not make a good morph. Fills alignment->energy. aims: NULL for none. */
ORB_MUST_CHECK orb_status orb_compose_all(orb_context *ctx, orb_alignment *alignment, orb_map_from from,
                                          const orb_aims *aims, orb_preset preset);

/* Method `auto` without landmarks; auto/auto.c describes it. The found landmarks and the confidence of the match are
 * left to the caller. If match.is_part is set, what is held for that are the landmarks of `out`, which the caller
 * forgets. */
ORB_MUST_CHECK orb_status orb_align_auto(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                         const orb_align_options *options, orb_alignment *out);

/* Extends an alignment of copies to the whole shapes. landmarks: the caller's, on the given meshes. The maps of the
 * copies are refined, soft landmarks are held by their springs, and what is held for a part, after the caller's
 * landmarks, stays held. The
 * alternatives become places on the given meshes. *lifted 0: a map folds at the level of its copy, and `alignment` is
 * empty. `copies` is used up in any case; the caller frees it. */
ORB_MUST_CHECK orb_status orb_align_lift(orb_context *ctx, orb_copies *copies, const orb_landmark *landmarks,
                                         int32_t landmark_count, orb_preset preset, orb_alignment *alignment,
                                         int *lifted);

/* Do rotations alone make the spheres of an alignment correspond? Then areas say more than angles, and the shapes keep
 * their spheres. O(n). */
ORB_MUST_CHECK orb_status orb_align_are_alike(orb_context *ctx, orb_alignment *a, orb_preset preset, int *alike);

#endif
