/* Trials that are extended from the part on which both of their directions agree (agreed.h). */
#ifndef ORB_ALIGN_FIND_EXTENDED_H
#define ORB_ALIGN_FIND_EXTENDED_H

#include "align/find/trials.h"

/* If the best trial bends the shapes more than ORB_FIND_EXTENDS, extends all that are not dropped side by side, each up
 * to ORB_FIND_EXTENSIONS times in a row, or ORB_FIND_EXTENSIONS_MIRRORED times if the copies have symmetries. The best
 * extension of a trial replaces it if that costs less. The trials must have been ranked, and their surveys have
 * distances. An extension that takes landmarks elsewhere replaces nothing. Each extension of small copies takes 0.01 s
 * of one thread. */
ORB_MUST_CHECK orb_status orb_trials_extend(orb_trials *trials);

#endif
