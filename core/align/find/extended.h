/* Trials that are extended from the part on which both of their directions agree (agreed.h). */
#ifndef ORB_ALIGN_FIND_EXTENDED_H
#define ORB_ALIGN_FIND_EXTENDED_H

#include "align/find/trials.h"

/* If the best trial bends the shapes more than ORB_FIND_EXTENDS, extends the best ones side by side, each up to
 * ORB_FIND_EXTENSIONS times in a row. The best extension of a trial replaces it if that costs less. The trials must
 * have been ranked, without landmarks. Each extension takes 0.05 s of one thread. */
ORB_MUST_CHECK orb_status orb_trials_extend(orb_trials *trials);

#endif
