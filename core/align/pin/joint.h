/* All shapes pinned at once on a base that suits them all. */
#ifndef ORB_ALIGN_PIN_JOINT_H
#define ORB_ALIGN_PIN_JOINT_H

#include "align/pin/room.h"

/* Pins the landmarks of all shapes by patches on a base that suits them all; its layout sets the targets. count ≥ 4.
 * *held: as for orb_pin_patches(). */
ORB_MUST_CHECK orb_status orb_pin_joint(orb_context *ctx, orb_sheet *sheets, int32_t shape_count,
                                        const int32_t *landmarks, int32_t count, orb_preset preset, orb_pin_room *room,
                                        int *held);

#endif
