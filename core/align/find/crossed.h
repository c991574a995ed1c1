/* Trials whose directions are registered again, each along the way back of the other one.
 *
 * The two directions of a trial can differ: a thin limb that is posed on a thick one arrives, while the thick one
 * crumples on its way. The pose of one direction, read backwards, is a rough map for the other. */
#ifndef ORB_ALIGN_FIND_CROSSED_H
#define ORB_ALIGN_FIND_CROSSED_H

#include "align/find/trials.h"

/* If the best trial bends the shapes more than ORB_FIND_EXTENDS, crosses those that cost at most
 * ORB_FIND_CROSSED_BEHIND times as much, side by side. Each direction keeps the pose that bends the shape less
 * (by cost, as many pairs of the seeds 17 and 29 are right). The trials must have been ranked. As long as two
 * registrations of each. */
ORB_MUST_CHECK orb_status orb_trials_cross(orb_trials *trials);

#endif
