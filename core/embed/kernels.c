/* Choice of the vector kernels at run time. */
#include "embed/kernels.h"

const orb_kernels *orb_kernels_of(orb_cpu cpu) {
#if defined(__x86_64__)
  if (cpu == ORB_CPU_AVX512) {
    return &orb_kernels_avx512;
  }
  if (cpu == ORB_CPU_AVX2) {
    return &orb_kernels_avx2;
  }
#endif
  (void)cpu;
  return &orb_kernels_plain;
}
