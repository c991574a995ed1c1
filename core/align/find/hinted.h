/* The trial that landmarks make, without a search. */
#ifndef ORB_ALIGN_FIND_HINTED_H
#define ORB_ALIGN_FIND_HINTED_H

#include "align/find/trials.h"

/* Makes one trial of surveyed copies from the landmarks of t->hint: each vertex goes to the vertex whose distances
 * along the surface from the landmarks are most alike. t must have no trials. O(n² landmarks). */
ORB_MUST_CHECK orb_status orb_trials_make_hinted(orb_trials *t);

/* Surveys the copies, makes that trial and registers it, each time from where it came to lie before. *bend: how much it
 * bends the shapes, the mean of both directions; INFINITY: there are too few landmarks, or it takes them elsewhere. If
 * it bends them by more than ORB_FIND_HINTED_BEND, t has no trials and no survey, as before. */
ORB_MUST_CHECK orb_status orb_trials_try_hinted(orb_trials *t, double *bend);

#endif
