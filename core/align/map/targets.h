/* The composed map where targets of the moving shape are given. */
#ifndef ORB_ALIGN_MAP_TARGETS_H
#define ORB_ALIGN_MAP_TARGETS_H

#include "align/map/engine/run.h"

/* Starts from run->given_target and improves the best map. Leaves the rest to the caller where the best is not a map of
 * shapes that correspond (energy above params.energy.poor): it has other ways. */
ORB_MUST_CHECK orb_status orb_map_follow_targets(orb_map_run *run);

#endif
