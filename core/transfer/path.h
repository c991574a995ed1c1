/* The in-between frames of a draft. */
#ifndef ORB_TRANSFER_PATH_H
#define ORB_TRANSFER_PATH_H

#include "transfer/draft.h"

/* Fills the frames after the shapes: positions, normals, colours. */
ORB_MUST_CHECK orb_status orb_draft_path(orb_context *ctx, orb_draft *draft);

#endif
