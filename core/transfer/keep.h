/* The asset of the remesh method "template" where the first shape came as glTF: its document, with targets. */
#ifndef ORB_TRANSFER_KEEP_H
#define ORB_TRANSFER_KEEP_H

#include "transfer/draft.h"

/* Appends the document with the frames of the draft after the first as targets. The draft has positions only. Fills
 * *facts; *vertices (unless NULL), *list and *count as orb_asset_write_document() says. */
ORB_MUST_CHECK orb_status orb_draft_keep(orb_context *ctx, const orb_draft *draft, const orb_document *document,
                                         const char *const *names, orb_asset_facts *facts, orb_buffer *out,
                                         int32_t **vertices, orb_dropped **list, int32_t *count);

/* Whether a document can be kept: fails as orb_draft_keep() would, for all reasons that the document gives. repaired:
 * the first shape before the alignment. */
ORB_MUST_CHECK orb_status orb_document_try(orb_context *ctx, const orb_mesh *repaired, const orb_document *document);

#endif
