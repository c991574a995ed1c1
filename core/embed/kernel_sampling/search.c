/* Eq. 2, the clipping of section 5.1 and Eq. 3 in single precision, many candidates at a time.
 *
 * `kernel-sampling` spends most of its time here. Three things make it fast. Coordinates are relative to the vertex and
 * divided by the ring's radius, so that floats serve small rings as well as large ones. All terms of Eq. 3 are
 * positive, so a candidate is dropped as soon as its sum reaches the current error: high exponents drop most of them
 * after one or two triangles. And the sum is scaled so that the current error is 1: what overflows is worse than the
 * current point, and what underflows does not count.
 *
 * The winner is measured again in double precision, and its signs are decided exactly. Loops run over candidates; the
 * same source is compiled for several vector widths, without contraction, so that all give the same bits.
 */
#include "embed/kernel_sampling/search.h"

#include <math.h>
#include <string.h>

#include "numeric/vec3.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

enum { LANES = KS_LANES };

#define KS_INLINE static inline __attribute__((always_inline))

/* The scale of the sum, as factors of the terms of Eq. 3: its root goes into a term with an exponent of 1 or more. */
typedef struct scaling {
  float angle, area, shape;
} scaling;

static scaling scale_to(double bound, double area_exponent, double aspect_exponent) {
  scaling c = {1, 1, 1};
  if (aspect_exponent >= 1) {
    c.shape = (float)fmax(1e-30, pow(bound, -1 / aspect_exponent));
  } else if (area_exponent >= 1) {
    c.area = (float)fmax(1e-30, pow(bound, -1 / area_exponent));
  } else {
    c.angle = (float)fmax(1e-30, 1 / bound);
  }
  return c;
}

static orb_ks_edge edge_of(const orb_ks_ring *r, int32_t i, const double apex[3], double inv_radius, scaling c) {
  int32_t j = i + 1 < r->count ? i + 1 : 0;
  double q[3], w[3], length = orb_length(r->plane[i]) + ORB_TINY;
  orb_sub(r->point[i], apex, q);
  orb_sub(r->point[j], apex, w);
  orb_ks_edge e;
  for (int k = 0; k < 3; k++) {
    e.q[k] = (float)(q[k] * inv_radius);
    e.w[k] = (float)(w[k] * inv_radius);
    e.normal[k] = (float)(r->plane[i][k] / length);
  }
  e.at = (float)(-orb_dot(r->plane[i], q) / length * inv_radius);
  e.a = (float)(r->side[i] * inv_radius);
  double mp = r->angle_p[i], mq = r->angle_q[i], mr = r->angle_r[i];
  e.k0 = (float)(0.5 * r->side2[i] * inv_radius * inv_radius * (mq + mr - mp)) * c.angle;
  e.kb = (float)(0.5 * (mp - mq + mr)) * c.angle;
  e.kc = (float)(0.5 * (mp + mq - mr)) * c.angle;
  double kappa = 0.5 * r->inverse_area[i] / (inv_radius * inv_radius);
  e.kappa = (float)kappa * c.area;
  e.inv_kappa = (float)(1 / kappa) * c.area;
  return e;
}

KS_INLINE void spread_lanes(const float *s, const float *t, int32_t pairs, float draw, float radius, const float *apex,
                            const orb_ks_edge *e, float *x, float *y, float *z) {
  float qx = draw * e->q[0], qy = draw * e->q[1], qz = draw * e->q[2];
  float wx = draw * e->w[0], wy = draw * e->w[1], wz = draw * e->w[2], ax = apex[0], ay = apex[1], az = apex[2];
  for (int32_t l = 0; l < pairs; l++) {
    float dx = s[l] * qx + t[l] * wx, dy = s[l] * qy + t[l] * wy, dz = s[l] * qz + t[l] * wz;
    /* |apex + radius·d|² = 1 + radius·rise; back on the sphere without cancellation. */
    float rise = 2 * (ax * dx + ay * dy + az * dz) + radius * (dx * dx + dy * dy + dz * dz);
    float norm = sqrtf(fabsf(1 + radius * rise) + 1e-30f), f = 1 / norm, sink = rise * f / (1 + norm);
    x[l] = dx * f - ax * sink;
    y[l] = dy * f - ay * sink;
    z[l] = dz * f - az * sink;
  }
}

/* Keeps the candidates whose key is below the limit, in their order; returns how many. */
static int32_t keep_below_plain(float limit, float *x, float *y, float *z, float *key, int32_t count) {
  int32_t kept = 0;
  for (int32_t l = 0; l < count; l++) {
    float e = key[l];
    x[kept] = x[l];
    y[kept] = y[l];
    z[kept] = z[l];
    key[kept] = e;
    kept += e < limit; /* false for NaN */
  }
  return kept;
}

#if defined(__x86_64__)
#if defined(__clang__)
#define KS_TARGET_512 "avx512f,avx512vl,avx512dq,avx512bw"
#else
#define KS_TARGET_512 "avx512f,avx512vl,avx512dq,avx512bw,prefer-vector-width=512"
#endif
__attribute__((target(KS_TARGET_512))) static int32_t keep_below_512(float limit, float *x, float *y, float *z,
                                                                     float *key, int32_t count) {
  int32_t kept = 0;
  __m512 bound = _mm512_set1_ps(limit);
  for (int32_t l = 0; l < count; l += LANES) {
    __mmask16 present = (__mmask16)(count - l < LANES ? (1u << (count - l)) - 1 : 0xffffu);
    __m512 e = _mm512_loadu_ps(key + l);
    __mmask16 keep = _mm512_mask_cmp_ps_mask(present, e, bound, _CMP_LT_OQ);
    __m512 px = _mm512_loadu_ps(x + l), py = _mm512_loadu_ps(y + l), pz = _mm512_loadu_ps(z + l);
    _mm512_storeu_ps(x + kept, _mm512_maskz_compress_ps(keep, px));
    _mm512_storeu_ps(y + kept, _mm512_maskz_compress_ps(keep, py));
    _mm512_storeu_ps(z + kept, _mm512_maskz_compress_ps(keep, pz));
    _mm512_storeu_ps(key + kept, _mm512_maskz_compress_ps(keep, e));
    kept += __builtin_popcount(keep);
  }
  return kept;
}
#endif

KS_INLINE int32_t keep_below(orb_cpu cpu, float limit, float *x, float *y, float *z, float *key, int32_t count) {
#if defined(__x86_64__)
  if (cpu == ORB_CPU_AVX512) {
    return keep_below_512(limit, x, y, z, key, count);
  }
#endif
  (void)cpu;
  return keep_below_plain(limit, x, y, z, key, count);
}

/* Measures how far each candidate lies outside the ring: the greatest distance beyond a plane, negative inside. */
KS_INLINE void measure_depth(const orb_ks_edge *edge, int32_t edges, const float *restrict x, const float *restrict y,
                             const float *restrict z, float *restrict beyond, int32_t count) {
  for (int32_t l = 0; l < count; l++) {
    beyond[l] = -INFINITY;
  }
  for (int32_t i = 0; i < edges; i++) {
    float nx = edge[i].normal[0], ny = edge[i].normal[1], nz = edge[i].normal[2], at = edge[i].at;
    for (int32_t l = 0; l < count; l++) {
      float d = -(nx * x[l] + ny * y[l] + nz * z[l] + at);
      beyond[l] = d > beyond[l] ? d : beyond[l];
    }
  }
}

/* x to the power `kind`: 1, 3 or 12. */
KS_INLINE float raised(float x, int kind) {
  float x3 = x * x * x, x6 = x3 * x3;
  return kind == 1 ? x : kind == 3 ? x3 : x6 * x6;
}

/* Raises each x to the power e; whole and half powers up to 64 by multiplication, bit by bit over all lanes. */
KS_INLINE void raise_lanes(float *restrict x, float e) {
  float doubled = 2 * e, power[LANES];
  if (doubled != floorf(doubled) || doubled < 0 || doubled > 128) {
    for (int32_t l = 0; l < LANES; l++) {
      x[l] = powf(x[l], e);
    }
    return;
  }
  int bits = (int)doubled;
  for (int32_t l = 0; l < LANES; l++) {
    power[l] = bits & 1 ? sqrtf(x[l]) : 1;
  }
  for (int b = bits >> 1; b; b >>= 1) {
    if (b & 1) {
      for (int32_t l = 0; l < LANES; l++) {
        power[l] *= x[l];
      }
    }
    for (int32_t l = 0; l < LANES; l++) {
      x[l] *= x[l];
    }
  }
  for (int32_t l = 0; l < LANES; l++) {
    x[l] = power[l];
  }
}

/* The factors of Eq. 3 of one ring triangle at a candidate, before their exponents. */
KS_INLINE void measure(const orb_ks_edge *e, float quarter, float x, float y, float z, float *angle, float *area,
                       float *shape) {
  float ux = e->q[0] - x, uy = e->q[1] - y, uz = e->q[2] - z, vx = e->w[0] - x, vy = e->w[1] - y, vz = e->w[2] - z;
  float c2 = ux * ux + uy * uy + uz * uz, b2 = vx * vx + vy * vy + vz * vz;
  float nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
  float n2 = nx * nx + ny * ny + nz * nz + 1e-36f, inv = 1 / sqrtf(n2), doubled = n2 * inv;
  float b = sqrtf(b2), c = sqrtf(c2);
  *area = doubled * e->kappa + inv * e->inv_kappa;
  *shape = quarter * e->a * b * c * (e->a + b + c) * inv * inv;
  *angle = (e->k0 + e->kb * b2 + e->kc * c2) * inv;
}

/* Adds the term of one ring triangle for exponents of 1, 3 or 12. */
KS_INLINE void add_term_lanes(const orb_ks_edge *edge, int area_kind, int shape_kind, float shape_scale,
                              const float *restrict x, const float *restrict y, const float *restrict z, int32_t count,
                              float *restrict error) {
  const orb_ks_edge e = *edge;
  float quarter = 0.25f * shape_scale;
  for (int32_t l = 0; l < count; l++) {
    float angle, area, shape;
    measure(&e, quarter, x[l], y[l], z[l], &angle, &area, &shape);
    error[l] += angle * raised(area, area_kind) * raised(shape, shape_kind);
  }
}

/* The same for any exponents. */
KS_INLINE void add_any_term(const orb_ks_edge *edge, float area_exponent, float aspect_exponent, float shape_scale,
                            const float *restrict x, const float *restrict y, const float *restrict z, int32_t count,
                            float *restrict error) {
  const orb_ks_edge e = *edge;
  float quarter = 0.25f * shape_scale, angle[LANES], area[LANES], shape[LANES];
  for (int32_t begin = 0; begin < count; begin += LANES) {
    for (int32_t l = 0; l < LANES; l++) {
      measure(&e, quarter, x[begin + l], y[begin + l], z[begin + l], &angle[l], &area[l], &shape[l]);
    }
    raise_lanes(area, area_exponent);
    raise_lanes(shape, aspect_exponent);
    for (int32_t l = 0; l < LANES; l++) {
      error[begin + l] += angle[l] * area[l] * shape[l];
    }
  }
}

typedef struct search {
  const orb_ks_edge *edge;
  int32_t edges, stride, pairs;
  const float *s, *t;
  float draw, radius, apex[3], area_exponent, aspect_exponent, shape_scale;
  float *x, *y, *z, *error;
  int32_t inside, best;
} search;

/* Loops run over whole vectors; what lies behind the last candidate is computed and ignored. */
KS_INLINE int32_t padded(int32_t count) {
  return (count + LANES - 1) / LANES * LANES;
}

KS_INLINE void run(search *q, orb_cpu cpu) {
  float *x = q->x, *y = q->y, *z = q->z, *error = q->error;
  int32_t count = 0;
  for (int32_t i = 0; i < q->edges; i += q->stride, count += q->pairs) {
    spread_lanes(q->s, q->t, q->pairs, q->draw, q->radius, q->apex, &q->edge[i], x + count, y + count, z + count);
  }
  measure_depth(q->edge, q->edges, x, y, z, error, count);
  count = q->inside = keep_below(cpu, 0, x, y, z, error, count);
  memset(error, 0, (size_t)padded(count) * sizeof *error);
  for (int32_t i = 0; i < q->edges && count > 0; i++) {
    if (q->area_exponent == 3 && q->aspect_exponent == 12) {
      add_term_lanes(&q->edge[i], 3, 12, q->shape_scale, x, y, z, padded(count), error);
    } else if (q->area_exponent == 3 && q->aspect_exponent == 1) {
      add_term_lanes(&q->edge[i], 3, 1, q->shape_scale, x, y, z, padded(count), error);
    } else {
      add_any_term(&q->edge[i], q->area_exponent, q->aspect_exponent, q->shape_scale, x, y, z, padded(count), error);
    }
    count = keep_below(cpu, 1, x, y, z, error, count);
  }
  float least = 1;
  q->best = -1;
  for (int32_t l = 0; l < count; l++) {
    if (error[l] < least) {
      least = error[l];
      q->best = l;
    }
  }
}

static void run_plain(search *q) {
  run(q, ORB_CPU_PLAIN);
}

#if defined(__x86_64__)
__attribute__((target("avx2"))) static void run_avx2(search *q) {
  run(q, ORB_CPU_AVX2);
}
__attribute__((target(KS_TARGET_512))) static void run_avx512(search *q) {
  run(q, ORB_CPU_AVX512);
}
#endif

static void run_widest(const orb_ks_sampler *s, search *q) {
#if defined(__x86_64__)
  if (s->cpu == ORB_CPU_AVX512) {
    run_avx512(q);
    return;
  }
  if (s->cpu == ORB_CPU_AVX2) {
    run_avx2(q);
    return;
  }
#endif
  (void)s;
  run_plain(q);
}

int orb_ks_search(orb_ks_sampler *s, const double apex[3], double draw, double bound, double out[3], double *error) {
  const orb_ks_ring *r = &s->ring;
  double radius2 = ORB_TINY;
  for (int32_t i = 0; i < r->count; i++) {
    double d2 = orb_distance2(r->point[i], apex);
    radius2 = d2 > radius2 ? d2 : radius2;
  }
  double radius = sqrt(radius2);
  scaling c = scale_to(bound, s->area_exponent, r->aspect_exponent);
  for (int32_t i = 0; i < r->count; i++) {
    s->edge[i] = edge_of(r, i, apex, 1 / radius, c);
  }
  float *x = s->near_candidate;
  search q = {.edge = s->edge,
              .edges = r->count,
              .stride = orb_ks_stride(s, r->count),
              .pairs = s->padded_count,
              .s = s->pair_s,
              .t = s->pair_t,
              .draw = (float)draw,
              .radius = (float)radius,
              .apex = {(float)apex[0], (float)apex[1], (float)apex[2]},
              .area_exponent = (float)s->area_exponent,
              .aspect_exponent = (float)r->aspect_exponent,
              .shape_scale = c.shape,
              .x = x,
              .y = x + s->room,
              .z = x + 2 * (size_t)s->room,
              .error = x + 3 * (size_t)s->room};
  run_widest(s, &q);
  s->kernel_points = q.inside;
  if (q.best < 0) {
    return 0;
  }
  out[0] = apex[0] + radius * (double)q.x[q.best];
  out[1] = apex[1] + radius * (double)q.y[q.best];
  out[2] = apex[2] + radius * (double)q.z[q.best];
  orb_normalize(out);
  *error = orb_ks_error_at(s, out);
  return *error < bound && orb_kernel_contains((const double(*)[3])r->point, r->count, out);
}
