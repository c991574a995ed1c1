/* Positions on a grid: base and targets become 16-bit integers, and the node's scale and translation undo that. */
#ifndef ORB_PROFILE_GRID_H
#define ORB_PROFILE_GRID_H

#include "profile/source.h"
#include "profile/stream.h"

/* Position = origin + step · (base + Σ weight · delta). */
typedef struct orb_grid {
  double step, origin[3];
  double diagonal; /* the smallest of the boxes that bound the base and the targets at full weight */
} orb_grid;

/* Chooses the grid for all primitives of the mesh: the longest side of the base's box has `levels` steps, at most
 * 65535, or fewer where a delta would otherwise not fit into 16 bits. ORB_E_CORRUPT. */
ORB_MUST_CHECK orb_status orb_grid_choose(orb_context *ctx, const orb_source *source, const cJSON *primitives,
                                          int32_t levels, orb_grid *out);

/* Rounds the base of a primitive, 3 floats per vertex. */
ORB_MUST_CHECK orb_status orb_grid_base(orb_context *ctx, const orb_grid *grid, const float *positions, int32_t count,
                                        orb_stream *out, double *error);
/* Rounds a target so that it is best at full weight: the delta is the difference of two rounded positions. Then the
 * error at weight w is (1 − w) times that of the base plus w times that at full weight, never more than the larger.
 * *error: raised to the largest distance from the position that the floats give. */
ORB_MUST_CHECK orb_status orb_grid_target(orb_context *ctx, const orb_grid *grid, const float *positions,
                                          const float *deltas, const orb_stream *base, orb_stream *out, double *error);
/* What float32 arithmetic in a renderer may add to any position. */
double orb_grid_rounding(const orb_grid *grid);

#endif
