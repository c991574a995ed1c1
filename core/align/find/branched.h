/* Trials of matches of tips by how limbs branch (branches.h). */
#ifndef ORB_ALIGN_FIND_BRANCHED_H
#define ORB_ALIGN_FIND_BRANCHED_H

#include "align/find/trials.h"

/* Adds up to ORB_FIND_BRANCHED trials to those that are ranked, each registered in both directions, and again from
 * where it came to lie. Call it where the best trial bends the shapes much. The surveys must have distances. A trial
 * that takes landmarks elsewhere, or that costs more than ORB_FIND_BRANCHED_BEHIND times what the best one costs, is
 * dropped. Side by side; for small copies each takes 0.02 s of one thread. */
ORB_MUST_CHECK orb_status orb_trials_branch(orb_trials *trials);

#endif
