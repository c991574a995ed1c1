/* Method `pin`: landmarks as constraints of the embeddings. */
#ifndef ORB_ALIGN_PIN_PIN_H
#define ORB_ALIGN_PIN_PIN_H

#include "align/sheet/sheet.h"

/* Landmarks as constraints of the embeddings: bit-equal points afterwards. */
ORB_MUST_CHECK orb_status orb_align_pin(orb_context *ctx, orb_sheet *sheets, int32_t shape_count,
                                        const int32_t *landmarks, int32_t count, const orb_align_options *options);

#endif
