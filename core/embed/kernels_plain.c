/* The kernels for any machine: on x86-64 two doubles at a time, on Arm NEON. */
#define ORB_LANES 2
#include "embed/lanes.inc.h"

#include "embed/cost_kernel.inc.h"
#include "embed/fill_kernel.inc.h"
#include "embed/level.h"
#include "embed/sweep_kernel.inc.h"

const orb_kernels orb_kernels_plain = {
    .name = "plain", .lanes = ORB_LANES, .costs = cost_range, .fill = fill_range, .sweep = sweep_range};
