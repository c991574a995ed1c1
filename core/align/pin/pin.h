/* Method `pin`: landmarks as constraints of the embeddings.
 *
 * In: sheets with landmarks. Out: the same sheets, embedded again so that the landmarks coincide, certified; perhaps
 * with more edges. Read in this order:
 *
 *   walk.h         landmarks walk to common targets on a coarse level: nearly all requests end here
 *   relax.h        sweeps with landmarks held
 *   room.h         what a pinning may use up
 *   paths.h, straighten.h, path_tracer.h  paths between vertices that do not cross
 *   base.h, base_trace.h  a triangulation of the targets, traced on a shape
 *   patches.h      landmarks pinned by patches, on one shape
 *   join.h, joint.h  a base that all shapes share, and all shapes pinned on it
 *   pin.c          which of these is tried when
 */
#ifndef ORB_ALIGN_PIN_PIN_H
#define ORB_ALIGN_PIN_PIN_H

#include "align/sheet/sheet.h"

/* Afterwards the vertices of a landmark have bit-equal points on all shapes. */
ORB_MUST_CHECK orb_status orb_align_pin(orb_context *ctx, orb_sheet *sheets, int32_t shape_count,
                                        const int32_t *landmarks, int32_t count, const orb_align_options *options);

#endif
