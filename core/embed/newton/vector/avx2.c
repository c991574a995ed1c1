/* The vector loops for AVX2 with FMA; CMake compiles this file with those flags where the processor family has them. */
#if defined(__x86_64__)
#define ORB_LANES 4
#include "numeric/lanes.inc.h"

#include "embed/newton/vector/jobs.h"

#include "embed/newton/vector/batch.inc.h"
#include "embed/newton/vector/cost.inc.h"
#include "embed/newton/vector/fill.inc.h"
#include "embed/newton/vector/sweep.inc.h"

const orb_vector_loops orb_vector_avx2 = {
    .name = "avx2", .lanes = BATCH, .costs = cost_range, .fill = fill_range, .sweep = sweep_range};
#else
typedef int orb_no_avx2;
#endif
