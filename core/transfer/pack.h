/* The bytes of the file. */
#ifndef ORB_TRANSFER_PACK_H
#define ORB_TRANSFER_PACK_H

#include "transfer/draft.h"

/* Appends the GLB of a finished draft, and fills *facts. */
ORB_MUST_CHECK orb_status orb_draft_write(orb_context *ctx, const orb_draft *draft, const char *const *names,
                                          orb_asset_facts *facts, orb_buffer *out);

#endif
