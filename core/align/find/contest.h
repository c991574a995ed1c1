/* The contest of the ways to make the map of two shapes that bend much.
 *
 * Their match leads to a map by landmark walks, whose energy on a coarse level tells how good the map will be. Either
 * shape can move, so both do, side by side. If both walks are poor, the shapes hardly correspond: then the next best
 * match walks as well. It also does if it costs hardly more than the best one. The best walk is finished, and another
 * one that is close.
 *
 * Rejected: a walk towards what fits best in space, where both are poor. Of 25 contests of real meshes it won two, one
 * of them by 12 %, and took 0.6 s each time. Rejected: walks towards the next best match in any case. Of 131 pairs of
 * animals of other kinds, one of the two best matches was right in 47 whose walks were compared: the best one in 45.
 * The walk with less energy was the right one in 37. Rejected: to compare two finished maps by the energy of both
 * shapes' triangles, and to finish the second best walk in any case. Of 89 pairs (seeds 17 and 29) 74 or 75 come out
 * right instead of 73, with 3 % less error, for up to a twentieth of the time; but a dog and an elephant with five
 * landmarks are half as far again from the truth. Rejected: to compare them by how far they lie from their targets. Of
 * 43 contests (seed 17) 33 come out right so, and 33 by energy; at best 36 can, since most wrong ones are wrong both
 * ways. */
#ifndef ORB_ALIGN_FIND_CONTEST_H
#define ORB_ALIGN_FIND_CONTEST_H

#include "align/find/match.h"
#include "orbmorph/alignment.h"
#include "orbmorph/remesh.h"

/* What has won. is_second 0: the match, and clear does not count. */
typedef struct orb_contest_result {
  int is_second; /* the next best match */
  double clear;  /* how clearly it has won, 0 to 1 */
  double loose;  /* the energy of its map before that is fitted in space; INFINITY: nothing has won */
} orb_contest_result;

/* Is a contest worth it? The spheres must keep angles. */
int orb_contest_is_open(const orb_match *match, int keep_angles);

/* Composes an alignment of two rotated spheres that keep angles towards what wins, and fills alignment->energy.
 * match->moves says which shape moves if only one can: a first shape that is large stays, since it is no copy
 * (align.c). landmark_count: landmarks of the alignment, which meet in every walk; with them the next best match does
 * not walk. known: the energy of another map of all vertices, or INFINITY. If no walk has less on its coarse level,
 * nothing wins, and the alignment stays as it is but for its energy, INFINITY. */
ORB_MUST_CHECK orb_status orb_contest_run(orb_context *ctx, const orb_match *match, int32_t landmark_count,
                                          double known, orb_preset preset, orb_alignment *alignment,
                                          orb_contest_result *out);

#endif
