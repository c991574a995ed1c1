/* The loop for any machine: two doubles at a time, by SSE2 on x86-64 and by NEON on Arm. */
#define ORB_LANES 2
#include "numeric/lanes.inc.h"

#include "align/map/engine/vector/sweep.inc.h"

const orb_map_loops orb_map_loops_plain = {"plain", ORB_LANES, step_range};
