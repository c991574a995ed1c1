/* The best trials of small copies, raised to coarse ones. */
#ifndef ORB_ALIGN_FIND_RAISED_H
#define ORB_ALIGN_FIND_RAISED_H

#include "align/find/trials.h"

/* Makes the first trials of coarse copies, which must have none, from the best ranked trials of small ones that differ,
 * and surveys these copies. A raised trial maps each vertex to where the small copies' poses carry it; it is still to
 * be registered. A dropped trial that is raised is completed before. */
ORB_MUST_CHECK orb_status orb_trials_raise(orb_trials *small, orb_trials *coarse);

#endif
