/* The contest of the matches of shapes that bend much.
 *
 * Such matches lead to maps by landmark walks, whose energy on a coarse level tells which map will be the better one:
 * of 57 pairs of other kinds, the match whose walk had clearly less energy also had the better map in all. So the
 * matches are walked side by side, and only the best walk is finished. If the walks of the two best matches are poor,
 * the third one and what fits best in space walk as well. A walk that is close to the best one is finished too. */
#ifndef ORB_ALIGN_FIND_CONTEST_H
#define ORB_ALIGN_FIND_CONTEST_H

#include "align/find/match.h"
#include "orbmorph/alignment.h"
#include "orbmorph/remesh.h"

/* What has won. All 0: the best match. clear counts for another match. */
typedef struct orb_contest_result {
  int is_space;  /* what fits best in space */
  int32_t other; /* 1 + the number of another match */
  double clear;  /* how clearly it has won, 0 to 1 */
} orb_contest_result;

/* Is a contest worth it? The spheres must keep angles, and the next best match must not be far behind. */
int orb_contest_is_open(const orb_match *match, int keep_angles);

/* Composes an alignment of two rotated spheres that keep angles towards what wins, and fills alignment->energy.
 * match->moves says which shape moves; a first shape that is large stays, since it is no copy (align.c). */
ORB_MUST_CHECK orb_status orb_contest_run(orb_context *ctx, const orb_match *match, orb_preset preset,
                                          orb_alignment *alignment, orb_contest_result *out);

#endif
