/* Non-rigid registration of one surface to another, as rigid as possible.
 *
 * In: two meshes, the first one of up to ten thousand vertices or so, and a rough map between them or places where the
 * first one lies already. Out: where the first one goes so that it lies on the second, and how much that bends it. A
 * rough map of the right limbs bends little, even if it misses their tips by a little. A map of the wrong limbs bends
 * much. So the cost ranks maps. Read in this order:
 *
 *   searched.h  vertices, laid out for searches of the nearest one
 *   body.h      a mesh with what the steps read
 *   stretch.h   how the surroundings of a vertex are stretched
 *   relief.h    how far a vertex stands out from its surroundings
 *   pose.h      what leads the first mesh, and where it is
 *   surroundings.h
 *               what is around a vertex
 *   registration.h, rough_map.h, places.h, rounds.h
 *               what a registration holds, what pulls it, and its rounds
 *   elastic.h   the registration
 *   ends.h      ends of limbs that a pose has crumpled
 *   mend.h      registers these ends anew
 *   slide.h     along the other surface, from where a map takes the first one
 *   carry.h     its pose, for other points
 *
 * Source: Sorkine & Alexa 2007 (as-rigid-as-possible energy: rotations of vertices and positions take turns), with
 * iterative closest points (Besl & McKay 1992) in both directions.
 */
#ifndef ORB_ELASTIC_ELASTIC_H
#define ORB_ELASTIC_ELASTIC_H

#include "elastic/pose.h"
#include "elastic/surroundings.h"

/* Moves mesh a to mesh b along a rough map, then to the nearest places, and its anchors, if any, to theirs. Both meshes
 * are scaled to the same area, near 4π, and have no vertex without triangles. around: the surroundings of a, which
 * several calls may share, or NULL. Fills the pose. *bend: mean squared change of the edges of a against the rotations
 * of their ends, relative to their squared lengths. O(n · m) a round, 8 rounds, and O(n²) before them: about 0.015 s
 * for two meshes of a thousand vertices. One thread; may run beside others in loops of the context. */
ORB_MUST_CHECK orb_status orb_elastic_register(orb_context *ctx, const orb_mesh *a, const orb_mesh *b,
                                               const orb_surroundings *around, const orb_rough_map *map,
                                               const orb_elastic_anchors *anchors, orb_elastic_pose *pose,
                                               double *bend);

/* Moves mesh a to the nearest places of mesh b, and its anchors to theirs, from a pose near them, in so many rounds, at
 * least 2. Changes the pose. mends: hands and other ends of limbs that arrive crumpled begin anew (mend.h). On all
 * threads. */
ORB_MUST_CHECK orb_status orb_elastic_settle(orb_context *ctx, const orb_mesh *a, const orb_mesh *b,
                                             const orb_elastic_anchors *anchors, int rounds, int mends,
                                             orb_elastic_pose *pose);

#endif
