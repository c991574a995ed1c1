/* The bytes of the file. */
#ifndef ORB_TRANSFER_PACK_H
#define ORB_TRANSFER_PACK_H

#include "transfer/draft.h"

/* Appends the GLB of a finished draft, and fills *facts. */
ORB_MUST_CHECK orb_status orb_draft_write(orb_context *ctx, const orb_draft *draft, const char *const *names,
                                          orb_asset_facts *facts, orb_buffer *out);

/* The frames of the animation and their times in seconds: shapes 0, …, N − 1, …, 0; each shape stays before it moves
 * on, and the in-betweens are spread evenly over the way. Returns how many there are; frames and times may both be
 * NULL.
 */
int32_t orb_draft_keys(const orb_draft *draft, int32_t *frames, double *times);

#endif
