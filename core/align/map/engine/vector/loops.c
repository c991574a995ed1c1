#include "align/map/engine/vector/loops.h"

const orb_map_loops *orb_map_loops_of(orb_cpu cpu) {
#if defined(__x86_64__)
  if (cpu == ORB_CPU_AVX512) {
    return &orb_map_loops_avx512;
  }
  if (cpu == ORB_CPU_AVX2) {
    return &orb_map_loops_avx2;
  }
#endif
  (void)cpu;
  return &orb_map_loops_plain;
}
