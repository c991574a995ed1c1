/* Tip maps by distances along the surfaces. */
#ifndef ORB_ALIGN_FIND_TIP_MAPS_H
#define ORB_ALIGN_FIND_TIP_MAPS_H

#include "align/find/tips.h"

/* Tip i of the first shape is tip to[i] of the second, −1: none. */
typedef struct orb_tip_map {
  int32_t count, to[ORB_TIPS_MAX];
  double score; /* how well distances, or directions, agree, summed over tips and pairs of them */
} orb_tip_map;

/* The maps of at least three tips whose distances agree best, best first; none is a part of another. Which way round
 * they turn is not looked at: mirror images are among them. */
void orb_tip_maps(const orb_tips *a, const orb_tips *b, orb_tip_map out[ORB_TIP_MAPS_MAX], int32_t *count);

/* The one map of at least three tips of which most tips lie beside each other, with distances that agree. beside: 1
 * at the same place, not positive: not to be matched. 0: there is none. */
int orb_tip_map_beside(const orb_tips *a, const orb_tips *b, double (*beside)[ORB_TIPS_MAX], orb_tip_map *out);

#endif
