/* The search over SO(3) for the rotation of one sphere that fits another. Matrices are row-major: q = R p. */
#ifndef ORB_ALIGN_ROTATE_CORRELATE_H
#define ORB_ALIGN_ROTATE_CORRELATE_H

#include "align/sheet/sheet.h"

/* The rotation of shape b's sphere under which the map a → b through the sphere is nearest to a rigid motion in space:
 * maximises the correlation of positions and normals over SO(3), on a coarse grid and then locally. The search also
 * finds the rigid motion, but prefers none (both shapes in one upright frame) where that explains nearly as much. score
 * (may be NULL): 1 for congruent shapes. About 0.1 s. */
ORB_MUST_CHECK orb_status orb_rotation_search(orb_context *ctx, const orb_aligned_shape *a, const orb_aligned_shape *b,
                                              double rotation[9], double *score);

/* At most `most` such rotations that differ, best first, 9 doubles each. The first is that of orb_rotation_search();
 * the others are further ways to match symmetric shapes. */
ORB_MUST_CHECK orb_status orb_rotation_candidates(orb_context *ctx, const orb_aligned_shape *a,
                                                  const orb_aligned_shape *b, int32_t most, double *rotations,
                                                  int32_t *count);

/* The search where few landmarks are known: `from` (on b) and `to` (on a), 3 doubles each. The mean of the squared
 * distances between them lowers the score of a rotation; so the shapes decide the rotation around one landmark, or
 * around two that are nearly opposite. */
ORB_MUST_CHECK orb_status orb_rotation_search_near(orb_context *ctx, const orb_aligned_shape *a,
                                                   const orb_aligned_shape *b, const double *from, const double *to,
                                                   int32_t count, double rotation[9], double *score);

#endif
