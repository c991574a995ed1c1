/* The kernels for AVX2 with FMA; compiled with those flags where the processor family has them. */
#if defined(__x86_64__)
#define ORB_LANES 4
#include "embed/lanes.inc.h"

#include "embed/cost_kernel.inc.h"
#include "embed/fill_kernel.inc.h"
#include "embed/level.h"
#include "embed/sweep_kernel.inc.h"

const orb_kernels orb_kernels_avx2 = {
    .name = "avx2", .lanes = ORB_LANES, .costs = cost_range, .fill = fill_range, .sweep = sweep_range};
#else
typedef int orb_no_avx2;
#endif
