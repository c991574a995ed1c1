/* Vertices spread evenly over a shape. */
#ifndef ORB_ALIGN_MAP_ENGINE_SPREAD_H
#define ORB_ALIGN_MAP_ENGINE_SPREAD_H

#include "orbmorph/context.h"

/* Spreads `count` vertices over a shape by farthest points, and writes their numbers. */
ORB_MUST_CHECK orb_status orb_map_spread(orb_context *ctx, const double *x, int32_t vertex_count, int32_t count,
                                         int32_t *out);

#endif
