/* Relaxation: sweeps over full surfaces with landmarks held. */
#ifndef ORB_ALIGN_PIN_RELAX_H
#define ORB_ALIGN_PIN_RELAX_H

#include "align/sheet/sheet.h"

/* Sweeps at full resolution with the landmarks pinned. If the result is not certified, the points stay as they were. */
ORB_MUST_CHECK orb_status orb_pin_relax(orb_context *ctx, orb_sheet *sheet, const int32_t *landmarks, int32_t count,
                                        orb_preset preset, int32_t sweeps);

/* Alternates such sweeps with orb_sheet_thin(), which removes what splits made and the landmarks no longer need. */
ORB_MUST_CHECK orb_status orb_pin_slim(orb_context *ctx, orb_sheet *sheet, const int32_t *landmarks, int32_t count,
                                       orb_preset preset, int64_t *work);

#endif
