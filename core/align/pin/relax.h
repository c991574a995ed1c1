/* Sweeps over full surfaces with landmarks held. */
#ifndef ORB_ALIGN_PIN_RELAX_H
#define ORB_ALIGN_PIN_RELAX_H

#include "align/sheet/sheet.h"

/* Sweeps at full resolution with the landmarks pinned, certified; where the sweeps do not lead to a certified
 * embedding the points stay as they were. */
ORB_MUST_CHECK orb_status orb_pin_relax(orb_context *ctx, orb_sheet *sheet, const int32_t *landmarks, int32_t count,
                                        orb_preset preset, int32_t sweeps);

/* Sweeps as above, and removes what splits made and the landmarks no longer need, by turns. */
ORB_MUST_CHECK orb_status orb_pin_slim(orb_context *ctx, orb_sheet *sheet, const int32_t *landmarks, int32_t count,
                                       orb_preset preset, int64_t *work);

#endif
