/* Short vectors: ORB_LANES doubles (vd) and as many 64-bit masks (vm), up to 8 floats (wf) and 32-bit masks (wm).
 * plain.c, avx2.c and avx512.c each include this once, after setting ORB_LANES, and are compiled for their instruction
 * set. Arithmetic is the compilers' vector extension; what that lacks (square root, choice) is an intrinsic or a
 * loop. */
#include <math.h>
#include <string.h>
#if defined(__AVX__)
#include <immintrin.h>
#endif

#include "embed/newton/vector/jobs.h"

#define ORB_WIDE (ORB_LANES > 4 ? 8 : 2 * ORB_LANES) /* a ring has about six vertices: of 16 floats most would idle */
enum { LANES = ORB_LANES, WIDE = ORB_WIDE };

typedef double vd __attribute__((vector_size(8 * ORB_LANES)));
typedef int64_t vm __attribute__((vector_size(8 * ORB_LANES)));
typedef float wf __attribute__((vector_size(4 * ORB_WIDE)));
typedef int32_t wm __attribute__((vector_size(4 * ORB_WIDE)));
typedef float vf __attribute__((vector_size(4 * ORB_LANES)));

static inline vd vd_set(double x) {
  return (vd){0} + x;
}
static inline wf wf_set(float x) {
  return (wf){0} + x;
}
static inline wf wf_load(const float *p) {
  wf out;
  memcpy(&out, p, sizeof out);
  return out;
}
static inline vd vd_load_floats(const float *p) {
  vf out;
  memcpy(&out, p, sizeof out);
  return __builtin_convertvector(out, vd);
}
static inline void vd_store_floats(float *p, vd x) {
  vf out = __builtin_convertvector(x, vf);
  memcpy(p, &out, sizeof out);
}
static inline vd vd_choose(vm mask, vd yes, vd no) {
  return (vd)((mask & (vm)yes) | (~mask & (vm)no));
}
static inline wf wf_choose(wm mask, wf yes, wf no) {
  return (wf)((mask & (wm)yes) | (~mask & (wm)no));
}
static inline int vm_any(vm mask) {
  int64_t any = 0;
  for (int i = 0; i < LANES; i++) {
    any |= mask[i];
  }
  return any != 0;
}
static inline double vd_sum(vd x) {
  double sum = 0;
  for (int i = 0; i < LANES; i++) {
    sum += x[i];
  }
  return sum;
}

#if ORB_LANES == 8 && defined(__AVX512F__)
static inline vd vd_sqrt(vd x) {
  return (vd)_mm512_sqrt_pd((__m512d)x);
}
static inline vd vd_max(vd x, vd y) {
  return (vd)_mm512_max_pd((__m512d)x, (__m512d)y);
}
static inline vd vd_min(vd x, vd y) {
  return (vd)_mm512_min_pd((__m512d)x, (__m512d)y);
}
#elif ORB_LANES == 4 && defined(__AVX__)
static inline vd vd_sqrt(vd x) {
  return (vd)_mm256_sqrt_pd((__m256d)x);
}
static inline vd vd_max(vd x, vd y) {
  return (vd)_mm256_max_pd((__m256d)x, (__m256d)y);
}
static inline vd vd_min(vd x, vd y) {
  return (vd)_mm256_min_pd((__m256d)x, (__m256d)y);
}
#else
static inline vd vd_sqrt(vd x) {
  for (int i = 0; i < LANES; i++) {
    x[i] = sqrt(x[i]);
  }
  return x;
}
static inline vd vd_max(vd x, vd y) {
  return vd_choose(x > y, x, y);
}
static inline vd vd_min(vd x, vd y) {
  return vd_choose(x < y, x, y);
}
#endif

#if ORB_LANES >= 4 && defined(__AVX__)
static inline wf wf_sqrt(wf x) {
  return (wf)_mm256_sqrt_ps((__m256)x);
}
static inline wf wf_max(wf x, wf y) {
  return (wf)_mm256_max_ps((__m256)x, (__m256)y);
}
#else
static inline wf wf_sqrt(wf x) {
  for (int i = 0; i < WIDE; i++) {
    x[i] = sqrtf(x[i]);
  }
  return x;
}
static inline wf wf_max(wf x, wf y) {
  return wf_choose(x > y, x, y);
}
#endif

/* Lane l gets the first three of the four doubles at point + 4·id[l]. */
#if ORB_LANES == 8 && defined(__AVX512F__)
static inline void vd_gather3(const double *point, const int32_t *id, vd out[3]) {
  __m256i at = _mm256_slli_epi32(_mm256_loadu_si256((const __m256i *)(const void *)id), 2);
  for (int k = 0; k < 3; k++) {
    out[k] = (vd)_mm512_i32gather_pd(at, point + k, 8);
  }
}
#elif ORB_LANES == 4 && defined(__AVX__)
static inline void vd_gather3(const double *point, const int32_t *id, vd out[3]) {
  __m256d a = _mm256_load_pd(point + 4 * (int64_t)id[0]), b = _mm256_load_pd(point + 4 * (int64_t)id[1]);
  __m256d c = _mm256_load_pd(point + 4 * (int64_t)id[2]), d = _mm256_load_pd(point + 4 * (int64_t)id[3]);
  __m256d xz0 = _mm256_unpacklo_pd(a, b), y0 = _mm256_unpackhi_pd(a, b);
  __m256d xz1 = _mm256_unpacklo_pd(c, d), y1 = _mm256_unpackhi_pd(c, d);
  out[0] = (vd)_mm256_permute2f128_pd(xz0, xz1, 0x20);
  out[1] = (vd)_mm256_permute2f128_pd(y0, y1, 0x20);
  out[2] = (vd)_mm256_permute2f128_pd(xz0, xz1, 0x31);
}
#else
static inline void vd_gather3(const double *point, const int32_t *id, vd out[3]) {
  double lane[3][ORB_LANES];
  for (int l = 0; l < LANES; l++) {
    for (int k = 0; k < 3; k++) {
      lane[k][l] = point[4 * (int64_t)id[l] + k];
    }
  }
  for (int k = 0; k < 3; k++) {
    memcpy(&out[k], lane[k], sizeof out[k]);
  }
}
#endif
