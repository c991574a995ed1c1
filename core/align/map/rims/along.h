/* Which points of two rims correspond. */
#ifndef ORB_ALIGN_MAP_RIMS_ALONG_H
#define ORB_ALIGN_MAP_RIMS_ALONG_H

#include "align/map/rims/pair.h"

/* Points of both rims, one place on each shape. Between them both rims are straight. */
typedef struct orb_rim_points {
  int32_t count;
  orb_place *at; /* 2 each */
} orb_rim_points;

/* Pairs the points of two rims by arc length, shifted by what the map says. The pairing then follows the map, unless a
 * part of a rim would get much longer or shorter (params->rims.slowest, fastest). Each vertex of either rim
 * is a point: where two are nearly at one place, they are one. Appends them to *points. most: points; beyond that, only
 * some vertices of the first rim. */
ORB_MUST_CHECK orb_status orb_rims_along(orb_context *ctx, const orb_map_params *params, const orb_rim_side sides[2],
                                         const orb_rim_pair *pair, int32_t most, orb_rim_points *points);
void orb_rim_points_free(orb_context *ctx, orb_rim_points *points);

#endif
