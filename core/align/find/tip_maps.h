/* Tip maps by distances along the surfaces. */
#ifndef ORB_ALIGN_FIND_TIP_MAPS_H
#define ORB_ALIGN_FIND_TIP_MAPS_H

#include "align/find/tips.h"

/* Tip i of the first shape is tip to[i] of the second, −1: none. */
typedef struct orb_tip_map {
  int32_t count, to[ORB_TIPS_MAX];
  double score; /* how well distances, or directions, agree, summed over tips and pairs of them */
} orb_tip_map;

/* The maps of at least three tips whose distances agree best, best first; none is a part of another. Distances do not
 * tell a map from its mirror image, so both are in the list. */
void orb_tip_maps(const orb_tips *a, const orb_tips *b, orb_tip_map out[ORB_TIP_MAPS_MAX], int32_t *count);

/* The map of at least three tips under which tips lie nearest beside each other and distances agree. beside: 1 at the
 * same place; pairs that are not positive are not matched. 0: there is no such map. */
int orb_tip_map_beside(const orb_tips *a, const orb_tips *b, double (*beside)[ORB_TIPS_MAX], orb_tip_map *out);

#endif
