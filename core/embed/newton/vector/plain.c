/* The vector loops for any machine: two doubles at a time, by SSE2 on x86-64 and by NEON on Arm. */
#define ORB_LANES 2
#include "numeric/lanes.inc.h"

#include "embed/newton/vector/jobs.h"

#include "embed/newton/vector/batch.inc.h"
#include "embed/newton/vector/cost.inc.h"
#include "embed/newton/vector/fill.inc.h"
#include "embed/newton/vector/sweep.inc.h"

const orb_vector_loops orb_vector_plain = {
    .name = "plain", .lanes = BATCH, .costs = cost_range, .fill = fill_range, .sweep = sweep_range};
