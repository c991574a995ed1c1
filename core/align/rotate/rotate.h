/* Method `rotate`: rotations of whole spheres, by landmarks or by search. Matrices are row-major: q = R p. */
#ifndef ORB_ALIGN_ROTATE_ROTATE_H
#define ORB_ALIGN_ROTATE_ROTATE_H

#include "align/sheet/sheet.h"

/* orb_procrustes_all() where the landmarks determine the rotations; where they do not (one, two, or all in nearly one
 * direction and its opposite), each later shape is turned by orb_rotation_search_near(). */
ORB_MUST_CHECK orb_status orb_rotations_find(orb_context *ctx, const orb_aligned_shape *const *shapes,
                                             const double *points, int32_t shape_count, int32_t landmark_count,
                                             double *rotations, double *means);

/* Rotates the sphere points of a surface and certifies the rounded result, with nudged rotations where rounding broke
 * a triangle; ORB_E_NOT_CERTIFIED if none holds. The identity changes nothing. */
ORB_MUST_CHECK orb_status orb_sheet_rotate(orb_context *ctx, orb_sheet *sheet, const double rotation[9]);

/* Generalised Procrustes, applied to the spheres. */
ORB_MUST_CHECK orb_status orb_rotate_by_landmarks(orb_context *ctx, orb_sheet *sheets, int32_t shape_count,
                                                  const int32_t *landmarks, int32_t count);

/* The same without landmarks: each later sphere takes the rotation of orb_rotation_search(). */
ORB_MUST_CHECK orb_status orb_rotate_by_search(orb_context *ctx, orb_sheet *sheets, int32_t shape_count);

#endif
