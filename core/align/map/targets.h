/* The composed map where targets of the moving shape are given. */
#ifndef ORB_ALIGN_MAP_TARGETS_H
#define ORB_ALIGN_MAP_TARGETS_H

#include "align/map/engine/run.h"

/* Starts from run->given_target and improves the best map. Of more than two shapes, the caller has other ways where
 * that is no map of shapes that correspond. With run->both, a walk may change the fixed shape's sphere. */
ORB_MUST_CHECK orb_status orb_map_follow_targets(orb_map_run *run);

#endif
