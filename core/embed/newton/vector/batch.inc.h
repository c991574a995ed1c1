/* What a sweep works on: a batch of BATCH vertices, as one vector of floats (bf, masks bm) or, half by half, as
 * doubles (vd). Included after numeric/lanes.inc.h. */

enum { BATCH = 2 * ORB_LANES, HALVES = 2 };

typedef float bf __attribute__((vector_size(8 * ORB_LANES)));
typedef int32_t bm __attribute__((vector_size(8 * ORB_LANES)));

#if ORB_LANES == 8
#define ORB_JOINED 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15
#define ORB_FIRST_HALF 0, 1, 2, 3, 4, 5, 6, 7
#define ORB_SECOND_HALF 8, 9, 10, 11, 12, 13, 14, 15
#elif ORB_LANES == 4
#define ORB_JOINED 0, 1, 2, 3, 4, 5, 6, 7
#define ORB_FIRST_HALF 0, 1, 2, 3
#define ORB_SECOND_HALF 4, 5, 6, 7
#else
#define ORB_JOINED 0, 1, 2, 3
#define ORB_FIRST_HALF 0, 1
#define ORB_SECOND_HALF 2, 3
#endif

static inline bf bf_set(float x) {
  return (bf){0} + x;
}
static inline bf bf_load(const float *p) {
  bf out;
  memcpy(&out, p, sizeof out);
  return out;
}
static inline bf bf_join(vd first, vd second) {
  return __builtin_shufflevector(__builtin_convertvector(first, vf), __builtin_convertvector(second, vf), ORB_JOINED);
}
static inline vd bf_half(bf x, int half) {
  vf out = half ? __builtin_shufflevector(x, x, ORB_SECOND_HALF) : __builtin_shufflevector(x, x, ORB_FIRST_HALF);
  return __builtin_convertvector(out, vd);
}
static inline bf bf_choose(bm mask, bf yes, bf no) {
  return (bf)((mask & (bm)yes) | (~mask & (bm)no));
}
/* The lanes before `count`. */
static inline bm bm_first(int count) {
  bm lane;
  for (int i = 0; i < BATCH; i++) {
    lane[i] = i;
  }
  return (bm)(lane < count);
}

#if ORB_LANES == 8 && defined(__AVX512F__)
static inline bf bf_sqrt(bf x) {
  return (bf)_mm512_sqrt_ps((__m512)x);
}
static inline bf bf_max(bf x, bf y) {
  return (bf)_mm512_max_ps((__m512)x, (__m512)y);
}
static inline bf bf_min(bf x, bf y) {
  return (bf)_mm512_min_ps((__m512)x, (__m512)y);
}
/* 1/x, within two units of the last place; NaN where x is 0. */
static inline bf bf_reciprocal(bf x) {
  bf y = (bf)_mm512_rcp14_ps((__m512)x);
  return y * (2 - x * y);
}
static inline float bf_sum(bf x) {
  return _mm512_reduce_add_ps((__m512)x);
}
static inline unsigned bm_bits(bm mask) {
  return (unsigned)_mm512_movepi32_mask((__m512i)mask);
}
#elif ORB_LANES == 4 && defined(__AVX__)
static inline bf bf_sqrt(bf x) {
  return (bf)_mm256_sqrt_ps((__m256)x);
}
static inline bf bf_max(bf x, bf y) {
  return (bf)_mm256_max_ps((__m256)x, (__m256)y);
}
static inline bf bf_min(bf x, bf y) {
  return (bf)_mm256_min_ps((__m256)x, (__m256)y);
}
static inline bf bf_reciprocal(bf x) {
  return 1 / x;
}
static inline float bf_sum(bf x) {
  return (x[0] + x[4]) + (x[1] + x[5]) + ((x[2] + x[6]) + (x[3] + x[7]));
}
static inline unsigned bm_bits(bm mask) {
  return (unsigned)_mm256_movemask_ps((__m256)mask);
}
#else
static inline bf bf_sqrt(bf x) {
  for (int i = 0; i < BATCH; i++) {
    x[i] = sqrtf(x[i]);
  }
  return x;
}
static inline bf bf_max(bf x, bf y) {
  return bf_choose(x > y, x, y);
}
static inline bf bf_min(bf x, bf y) {
  return bf_choose(x < y, x, y);
}
static inline bf bf_reciprocal(bf x) {
  return 1 / x;
}
static inline float bf_sum(bf x) {
  return (x[0] + x[1]) + (x[2] + x[3]);
}
static inline unsigned bm_bits(bm mask) {
  unsigned bits = 0;
  for (int i = 0; i < BATCH; i++) {
    bits |= mask[i] ? 1U << i : 0U;
  }
  return bits;
}
#endif
static inline int bm_any(bm mask) {
  return bm_bits(mask) != 0;
}

/* Sets the point at 4·id[l] to lane l of to, with a fourth coordinate of 0. */
#if ORB_LANES == 8 && defined(__AVX512F__)
static inline void vd_scatter3(double *point, const int32_t *id, const vd to[3]) {
  __m512d x = (__m512d)to[0], y = (__m512d)to[1], z = (__m512d)to[2], zero = _mm512_setzero_pd();
  __m512d xy[2] = {_mm512_unpacklo_pd(x, y), _mm512_unpackhi_pd(x, y)}; /* lanes 0 2 4 6, and 1 3 5 7 */
  __m512d z0[2] = {_mm512_unpacklo_pd(z, zero), _mm512_unpackhi_pd(z, zero)};
  for (int odd = 0; odd < 2; odd++) {
    __m512d low = _mm512_shuffle_f64x2(xy[odd], z0[odd], 0x44), high = _mm512_shuffle_f64x2(xy[odd], z0[odd], 0xee);
    low = _mm512_shuffle_f64x2(low, low, 0xd8); /* xy0 z0 xy2 z2 */
    high = _mm512_shuffle_f64x2(high, high, 0xd8);
    _mm256_storeu_pd(point + 4 * (int64_t)id[odd], _mm512_castpd512_pd256(low));
    _mm256_storeu_pd(point + 4 * (int64_t)id[odd + 2], _mm512_extractf64x4_pd(low, 1));
    _mm256_storeu_pd(point + 4 * (int64_t)id[odd + 4], _mm512_castpd512_pd256(high));
    _mm256_storeu_pd(point + 4 * (int64_t)id[odd + 6], _mm512_extractf64x4_pd(high, 1));
  }
}
#elif ORB_LANES == 4 && defined(__AVX__)
static inline void vd_scatter3(double *point, const int32_t *id, const vd to[3]) {
  __m256d x = (__m256d)to[0], y = (__m256d)to[1], z = (__m256d)to[2], zero = _mm256_setzero_pd();
  __m256d xy[2] = {_mm256_unpacklo_pd(x, y), _mm256_unpackhi_pd(x, y)}; /* lanes 0 2, and 1 3 */
  __m256d z0[2] = {_mm256_unpacklo_pd(z, zero), _mm256_unpackhi_pd(z, zero)};
  for (int odd = 0; odd < 2; odd++) {
    _mm256_storeu_pd(point + 4 * (int64_t)id[odd], _mm256_permute2f128_pd(xy[odd], z0[odd], 0x20));
    _mm256_storeu_pd(point + 4 * (int64_t)id[odd + 2], _mm256_permute2f128_pd(xy[odd], z0[odd], 0x31));
  }
}
#else
static inline void vd_scatter3(double *point, const int32_t *id, const vd to[3]) {
  for (int l = 0; l < LANES; l++) {
    for (int k = 0; k < 3; k++) {
      point[4 * (int64_t)id[l] + k] = to[k][l];
    }
  }
}
#endif
