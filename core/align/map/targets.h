/* The composed map from given targets of the moving shape. */
#ifndef ORB_ALIGN_MAP_TARGETS_H
#define ORB_ALIGN_MAP_TARGETS_H

#include "align/map/engine/run.h"

/* Starts from run->given_target and improves the best map. If that gives no map of shapes that correspond, the caller
 * has other ways with more than two shapes. With run->both, a walk may change the fixed shape's sphere. */
ORB_MUST_CHECK orb_status orb_map_follow_targets(orb_map_run *run);

#endif
