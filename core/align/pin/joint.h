/* All shapes pinned at once on a base that suits them all. */
#ifndef ORB_ALIGN_PIN_JOINT_H
#define ORB_ALIGN_PIN_JOINT_H

#include "align/pin/room.h"

/* The same for all shapes at once, on a base that suits them all and with targets of its own; count ≥ 4. */
ORB_MUST_CHECK orb_status orb_pin_joint(orb_context *ctx, orb_sheet *sheets, int32_t shape_count,
                                        const int32_t *landmarks, int32_t count, orb_preset preset, orb_pin_room *room,
                                        int *held);

#endif
