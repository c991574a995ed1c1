/* The vertices of the file. */
#ifndef ORB_TRANSFER_SPLIT_H
#define ORB_TRANSFER_SPLIT_H

#include "transfer/draft.h"

/* Fills draft->parts, with triangles and vertices in an order that suits the caches of graphics processors. */
ORB_MUST_CHECK orb_status orb_draft_split(orb_context *ctx, orb_draft *draft);

#endif
