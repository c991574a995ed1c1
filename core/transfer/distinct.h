/* Rounding to float32: base positions and deltas such that no two supermesh vertices coincide in every shape. */
#ifndef ORB_TRANSFER_DISTINCT_H
#define ORB_TRANSFER_DISTINCT_H

#include "orbmorph/asset.h"

/* positions: frame_count × 3·vertex_count doubles, the first frame being the base. base and deltas ((frame_count − 1) ×
 * 3·vertex_count) receive neither negative zeros nor values beyond float32: ORB_E_NOT_CERTIFIED names the shape. base +
 * delta in float32 arithmetic is within one unit in the last place of each frame's coordinate, or of the base's where
 * that is larger. Vertices that would coincide in all of the first `shapes` frames are nudged on the base; *nudged
 * counts them. keep: one byte a vertex; a vertex so marked (a landmark) is nudged only against another such. O(V·F)
 * expected. */
ORB_MUST_CHECK orb_status orb_round_distinct(orb_context *ctx, double *const *positions, int32_t frame_count,
                                             int32_t shapes, int32_t vertex_count, const unsigned char *keep,
                                             float *base, float *const *deltas, int32_t *nudged);

#endif
