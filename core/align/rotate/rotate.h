/* Method `rotate`: rotations of whole spheres, by landmarks or by search. Matrices are row-major: q = R p.
 *
 * In: sheets, perhaps with landmarks. Out: the same with rotated spheres, certified. Read in this order:
 *
 *   procrustes.h  rotations by landmarks
 *   correlate.h   the search without landmarks, or with too few
 *   rotate.h      which of the two, and applying it
 */
#ifndef ORB_ALIGN_ROTATE_ROTATE_H
#define ORB_ALIGN_ROTATE_ROTATE_H

#include "align/sheet/sheet.h"

/* orb_procrustes_all() where the landmarks determine the rotations. Where they do not (one, two, or all nearly on one
 * axis), orb_rotation_search_near() finds the rotation of each later shape. */
ORB_MUST_CHECK orb_status orb_rotations_find(orb_context *ctx, const orb_aligned_shape *const *shapes,
                                             const double *points, int32_t shape_count, int32_t landmark_count,
                                             double *rotations, double *means);

/* Applies orb_rotations_find() to the spheres, and certifies the results. */
ORB_MUST_CHECK orb_status orb_rotate_by_landmarks(orb_context *ctx, orb_sheet *sheets, int32_t shape_count,
                                                  const int32_t *landmarks, int32_t count);

/* Applies orb_rotation_search() to each later sphere, and certifies the results. */
ORB_MUST_CHECK orb_status orb_rotate_by_search(orb_context *ctx, orb_sheet *sheets, int32_t shape_count);

#endif
