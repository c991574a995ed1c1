/* Choice of the vector kernels at run time. */
#include "embed/kernels.h"

int orb_kernels_list(const orb_kernels *out[4]) {
  int count = 0;
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
      __builtin_cpu_supports("avx512bw")) {
    out[count++] = &orb_kernels_avx512;
  }
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    out[count++] = &orb_kernels_avx2;
  }
#endif
  out[count++] = &orb_kernels_plain;
  return count;
}

const orb_kernels *orb_kernels_best(void) {
  const orb_kernels *list[4];
  (void)orb_kernels_list(list);
  return list[0];
}
