/* Whether one of two shapes is a part of the other one, as a head is of a bust.
 *
 * In: coarse copies of two shapes, scaled to one area, and perhaps landmarks on them. Out: pairs of vertices of the
 * part that correspond. A map of least energy spreads a part over the whole, since it stretches all places alike, and
 * it bends the copies little; so neither energy nor bend tells that it is wrong. Space does: at another size, most of
 * the part lies on the surface of the whole, and what it leaves uncovered is one piece. If the torso of a horse lies on
 * that of a cow, the limbs are uncovered, which are many.
 *
 * Of many places, turns and sizes, the best by a grid of distances (grid.h, starts.h) follow closest points (follow.h;
 * Besl & McKay 1992) with a scale (Umeyama 1991). Points that are apart or face other ways count less. */
#ifndef ORB_ALIGN_FIND_INSET_INSET_H
#define ORB_ALIGN_FIND_INSET_INSET_H

#include "align/find/params.h"
#include "orbmorph/context.h"

typedef struct orb_trials orb_trials; /* trials.h */

typedef struct orb_inset {
  int32_t count; /* 0: neither shape is a part of the other one */
  /* Vertices of both shapes, which correspond: spread over the part; none comes twice. */
  int32_t vertex[2][ORB_FIND_INSET_PAIRS];
} orb_inset;

/* Do the landmarks of the trials leave open that one shape is a part of the other one, and do they not show it by
 * themselves (map/space/part.h)? trials: opened. O(landmarks). */
int orb_inset_is_possible(const orb_trials *trials);

/* trials: opened and surveyed. A part that takes a landmark far from its partner is none; soft landmarks do not count,
 * if there are enough others. About 0.1 s of one thread, on two threads if there are two. */
ORB_MUST_CHECK orb_status orb_inset_find(const orb_trials *trials, orb_inset *out);

#endif
