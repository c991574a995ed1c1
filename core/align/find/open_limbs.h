/* How many limbs landmarks say nothing of. */
#ifndef ORB_ALIGN_FIND_OPEN_LIMBS_H
#define ORB_ALIGN_FIND_OPEN_LIMBS_H

#include "align/find/trials.h"

/* The number of tips (tips.h) of a shape that have no landmark, exact or soft, within ORB_FIND_HINT_TELLS along the
 * surface: the larger of the two shapes' numbers. The surveys of `t` must be measured. O(n² + landmarks). */
ORB_MUST_CHECK orb_status orb_open_limbs_count(const orb_trials *t, int32_t *count);

#endif
