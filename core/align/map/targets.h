/* The composed map from given targets of the moving shape. */
#ifndef ORB_ALIGN_MAP_TARGETS_H
#define ORB_ALIGN_MAP_TARGETS_H

#include "align/map/engine/run.h"

/* Makes the walks towards run->given_target, of which `out` becomes the best, up to their coarse level. Free `out` in
 * any case. */
ORB_MUST_CHECK orb_status orb_map_target_walks(orb_map_run *run, struct orb_map_walked *out);

/* Starts from run->given_target and improves the best map. If that gives no map of shapes that correspond, the caller
 * has other ways with more than two shapes. With run->both, a walk may change the fixed shape's sphere. If
 * run->drafted is set, it is the best walk, and is used up. */
ORB_MUST_CHECK orb_status orb_map_follow_targets(orb_map_run *run);

#endif
