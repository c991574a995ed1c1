/* The parts of a merge's report that compare several shapes or landmarks. Call them in this order. */
#ifndef ORB_MERGE_REPORT_H
#define ORB_MERGE_REPORT_H

#include "orbmorph/merge.h"

/* Fills out->landmark_residuals. Needs out->alignment, supermesh and shapes. */
ORB_MUST_CHECK orb_status orb_report_landmarks(orb_context *ctx, const orb_align_shape *shapes,
                                               const orb_landmark *landmarks, orb_merge_result *out);

/* Fills out->found_residuals and found_names. Needs out->alignment, supermesh and shapes. */
ORB_MUST_CHECK orb_status orb_report_found(orb_context *ctx, const orb_align_shape *shapes, orb_merge_result *out);

/* Fills out->pairs and out->warnings. Needs out->alignment and supermesh. number: of each triangle of the supermesh in
 * the first shape's file, below 0: none; NULL: the supermesh is not that file's mesh. */
ORB_MUST_CHECK orb_status orb_report_pairs(orb_context *ctx, const int32_t *number, orb_merge_result *out);

#endif
