/* The kernels for AVX-512; compiled with those flags where the processor family has them. */
#if defined(__x86_64__)
#define ORB_LANES 8
#include "embed/lanes.inc.h"

#include "embed/cost_kernel.inc.h"
#include "embed/fill_kernel.inc.h"
#include "embed/level.h"
#include "embed/sweep_kernel.inc.h"

const orb_kernels orb_kernels_avx512 = {
    .name = "avx512", .lanes = ORB_LANES, .costs = cost_range, .fill = fill_range, .sweep = sweep_range};
#else
typedef int orb_no_avx512;
#endif
