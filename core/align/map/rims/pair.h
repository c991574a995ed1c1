/* Which holes of two shapes correspond. */
#ifndef ORB_ALIGN_MAP_RIMS_PAIR_H
#define ORB_ALIGN_MAP_RIMS_PAIR_H

#include "align/map/engine/params.h"
#include "align/map/rims/side.h"

typedef struct orb_rim_pair {
  int32_t hole[2]; /* of either side */
} orb_rim_pair;

/* Pairs holes one to one: those whose rims the map takes nearest to each other first, if their rims are about as long
 * and near. If each shape has one hole, these correspond. The caller frees *pairs. O(edges of all rims of one side, for
 * each of the other). */
ORB_MUST_CHECK orb_status orb_rims_pair(orb_context *ctx, const orb_map_params *params, const orb_rim_side sides[2],
                                        orb_rim_pair **pairs, int32_t *count);

#endif
