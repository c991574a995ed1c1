/* Trials that take mirror images to mirror images.
 *
 * In: trials of small copies whose symmetries are known (symmetry.h). Out: how far each trial is from keeping them, and
 * trials that are right on one side, mirrored to the other side.
 *
 * A limb that lies on a wrong one may bend the shapes less than one that lies on its own: an arm on a trunk, a leg on a
 * tail. But then left and right do not correspond. */
#ifndef ORB_ALIGN_FIND_MIRRORED_H
#define ORB_ALIGN_FIND_MIRRORED_H

#include "align/find/trials.h"

/* Sets the asymmetry of all trials of `trials`, and their costs: by both directions, or by the first one of those that
 * were dropped. They are trials of the small copies, or of the coarse ones that these were made of. Nothing happens if
 * a small copy has no symmetry. O(n) a trial. */
ORB_MUST_CHECK orb_status orb_trials_weigh_asymmetry(const orb_trials *small, orb_trials *trials);

/* Mirrors the best trials that differ, each from one side to the other and the reverse, extends and registers what
 * comes of it, and keeps what costs less. Call it after orb_trials_weigh_asymmetry(). Two registrations in each
 * direction a trial, side by side. */
ORB_MUST_CHECK orb_status orb_trials_mirror(orb_trials *trials);

#endif
