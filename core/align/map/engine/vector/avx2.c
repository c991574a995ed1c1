/* The loop for AVX2 with FMA; CMake compiles this file with those flags where the processor family has them. */
#if defined(__x86_64__)
#define ORB_LANES 4
#include "numeric/lanes.inc.h"

#include "align/map/engine/vector/sweep.inc.h"

const orb_map_loops orb_map_loops_avx2 = {"avx2", ORB_LANES, step_range};
#else
typedef int orb_map_no_avx2;
#endif
