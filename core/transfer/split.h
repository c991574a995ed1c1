/* The vertices of the file. */
#ifndef ORB_TRANSFER_SPLIT_H
#define ORB_TRANSFER_SPLIT_H

#include "transfer/draft.h"

/* The material of a triangle of the supermesh: that of the first shape at its centre. */
int32_t orb_draft_material(const orb_draft *draft, int64_t triangle);

/* Fills draft->parts, with triangles and vertices in an order that suits the caches of graphics processors. */
ORB_MUST_CHECK orb_status orb_draft_split(orb_context *ctx, orb_draft *draft);

#endif
