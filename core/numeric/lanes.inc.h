/* Short vectors: ORB_LANES doubles (vd) and as many 64-bit masks (vm), up to 8 floats (wf) and 32-bit masks (wm). A
 * source file of vector loops includes this once, after setting ORB_LANES, and is compiled for its instruction set.
 * Arithmetic is the compilers' vector extension; what that lacks (square root, choice) is an intrinsic or a loop. */
#include <math.h>
#include <stdint.h>
#include <string.h>
#if defined(__AVX__)
#include <immintrin.h>
#endif

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
#if ORB_LANES == 8 && defined(__AVX512F__)
static inline int vm_any(vm mask) {
  return _mm512_test_epi64_mask((__m512i)mask, (__m512i)mask) != 0;
}
#elif ORB_LANES == 4 && defined(__AVX__)
static inline int vm_any(vm mask) {
  return !_mm256_testz_si256((__m256i)mask, (__m256i)mask);
}
#else
static inline int vm_any(vm mask) {
  int64_t any = 0;
  for (int i = 0; i < LANES; i++) {
    any |= mask[i];
  }
  return any != 0;
}
#endif

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

/* Lane l gets the four doubles, or the four floats, at row[l]. Loads and shuffles are faster than gathers. */
#if ORB_LANES == 8 && defined(__AVX512F__)
static inline __m512d lanes_two_rows(const double *low, const double *high) {
  return _mm512_insertf64x4(_mm512_castpd256_pd512(_mm256_loadu_pd(low)), _mm256_loadu_pd(high), 1);
}
static inline void vd_rows4(const double *const row[ORB_LANES], vd out[4]) {
  __m512d a = lanes_two_rows(row[0], row[4]), b = lanes_two_rows(row[1], row[5]);
  __m512d c = lanes_two_rows(row[2], row[6]), d = lanes_two_rows(row[3], row[7]);
  __m512d xz0 = _mm512_unpacklo_pd(a, b), yw0 = _mm512_unpackhi_pd(a, b);
  __m512d xz1 = _mm512_unpacklo_pd(c, d), yw1 = _mm512_unpackhi_pd(c, d);
  const __m512i even = _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13), odd = _mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15);
  out[0] = (vd)_mm512_permutex2var_pd(xz0, even, xz1);
  out[1] = (vd)_mm512_permutex2var_pd(yw0, even, yw1);
  out[2] = (vd)_mm512_permutex2var_pd(xz0, odd, xz1);
  out[3] = (vd)_mm512_permutex2var_pd(yw0, odd, yw1);
}
static inline void vd_float_rows4(const float *const row[ORB_LANES], vd out[4]) {
  __m256 r[4];
  for (int l = 0; l < 4; l++) {
    r[l] = _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(row[l])), _mm_loadu_ps(row[l + 4]), 1);
  }
  __m256 xy0 = _mm256_unpacklo_ps(r[0], r[1]), zw0 = _mm256_unpackhi_ps(r[0], r[1]);
  __m256 xy1 = _mm256_unpacklo_ps(r[2], r[3]), zw1 = _mm256_unpackhi_ps(r[2], r[3]);
  out[0] = (vd)_mm512_cvtps_pd(_mm256_shuffle_ps(xy0, xy1, _MM_SHUFFLE(1, 0, 1, 0)));
  out[1] = (vd)_mm512_cvtps_pd(_mm256_shuffle_ps(xy0, xy1, _MM_SHUFFLE(3, 2, 3, 2)));
  out[2] = (vd)_mm512_cvtps_pd(_mm256_shuffle_ps(zw0, zw1, _MM_SHUFFLE(1, 0, 1, 0)));
  out[3] = (vd)_mm512_cvtps_pd(_mm256_shuffle_ps(zw0, zw1, _MM_SHUFFLE(3, 2, 3, 2)));
}
#elif ORB_LANES == 4 && defined(__AVX__)
static inline void vd_rows4(const double *const row[ORB_LANES], vd out[4]) {
  __m256d a = _mm256_loadu_pd(row[0]), b = _mm256_loadu_pd(row[1]);
  __m256d c = _mm256_loadu_pd(row[2]), d = _mm256_loadu_pd(row[3]);
  __m256d xz0 = _mm256_unpacklo_pd(a, b), yw0 = _mm256_unpackhi_pd(a, b);
  __m256d xz1 = _mm256_unpacklo_pd(c, d), yw1 = _mm256_unpackhi_pd(c, d);
  out[0] = (vd)_mm256_permute2f128_pd(xz0, xz1, 0x20);
  out[1] = (vd)_mm256_permute2f128_pd(yw0, yw1, 0x20);
  out[2] = (vd)_mm256_permute2f128_pd(xz0, xz1, 0x31);
  out[3] = (vd)_mm256_permute2f128_pd(yw0, yw1, 0x31);
}
static inline void vd_float_rows4(const float *const row[ORB_LANES], vd out[4]) {
  __m128 r[4];
  for (int l = 0; l < 4; l++) {
    r[l] = _mm_loadu_ps(row[l]);
  }
  _MM_TRANSPOSE4_PS(r[0], r[1], r[2], r[3]);
  for (int k = 0; k < 4; k++) {
    out[k] = (vd)_mm256_cvtps_pd(r[k]);
  }
}
#else
static inline void vd_rows4(const double *const row[ORB_LANES], vd out[4]) {
  double lane[4][ORB_LANES];
  for (int l = 0; l < LANES; l++) {
    for (int k = 0; k < 4; k++) {
      lane[k][l] = row[l][k];
    }
  }
  memcpy(out, lane, sizeof lane);
}
static inline void vd_float_rows4(const float *const row[ORB_LANES], vd out[4]) {
  double lane[4][ORB_LANES];
  for (int l = 0; l < LANES; l++) {
    for (int k = 0; k < 4; k++) {
      lane[k][l] = row[l][k];
    }
  }
  memcpy(out, lane, sizeof lane);
}
#endif
