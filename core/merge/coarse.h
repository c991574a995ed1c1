/* Where a template's own triangles are too coarse for a later shape. */
#ifndef ORB_MERGE_COARSE_H
#define ORB_MERGE_COARSE_H

#include "orbmorph/merge.h"

/* Fills out->coarse for the method template. Needs out->alignment, supermesh and shapes. repaired: the first shape as
 * it was aligned. tolerance: relative to the diagonal. Measures only shapes whose proved distance exceeds it. O(F log
 * F) for F triangles of both surfaces. */
ORB_MUST_CHECK orb_status orb_report_coarse(orb_context *ctx, const orb_mesh *repaired, double tolerance,
                                            orb_merge_result *out);

#endif
