#include "embed/newton/vector/loops.h"

const orb_vector_loops *orb_vector_loops_of(orb_cpu cpu) {
#if defined(__x86_64__)
  if (cpu == ORB_CPU_AVX512) {
    return &orb_vector_avx512;
  }
  if (cpu == ORB_CPU_AVX2) {
    return &orb_vector_avx2;
  }
#endif
  (void)cpu;
  return &orb_vector_plain;
}
