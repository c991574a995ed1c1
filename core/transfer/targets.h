/* The frames of morph targets that are not shapes. */
#ifndef ORB_TRANSFER_TARGETS_H
#define ORB_TRANSFER_TARGETS_H

#include "transfer/draft.h"

/* Fills the frames after the in-betweens: positions; normals, where the draft has them, which rotate with the smooth
 * normal of the surface; and colours, which stay. */
ORB_MUST_CHECK orb_status orb_draft_targets(orb_context *ctx, orb_draft *draft);

#endif
