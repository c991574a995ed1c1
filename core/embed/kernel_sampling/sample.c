/* Loops run over the candidates of a ring, so that the compiler can use the widest vectors of the processor. */
#include "embed/kernel_sampling/sample.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "numeric/clones.h"
#include "numeric/vec3.h"

enum { MAX_PAIRS = 20000 }; /* of (s, t); the smallest step, 0.01, makes fewer than 5,000 */

/* A ring with less than this share of its area is squeezed: see kernel_sampling.h. */
static const double SQUEEZED = 1e-4;

/* Least area of a triangle in the angle term, which divides by it, as a share of the mean. */
static const double AREA_FLOOR = 1e-2;

orb_status orb_ks_sampler_create(orb_context *ctx, const orb_embed_options *options, orb_ks_sampler *out) {
  orb_ks_sampler s = {.area_exponent = options->area_exponent, .aspect_exponent = options->aspect_exponent};
  int32_t steps = (int32_t)floor(1 / options->step);
  s.pair = orb_alloc(ctx, MAX_PAIRS, sizeof *s.pair);
  if (!s.pair) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 1; i <= steps; i++) {
    for (int32_t j = 1; i + j <= steps; j++) {
      double a = i * options->step, b = j * options->step;
      if (a + b < 1 && s.pair_count < MAX_PAIRS) {
        double *pair = s.pair[s.pair_count++];
        pair[0] = a;
        pair[1] = b;
      }
    }
  }
  s.padded_count = (s.pair_count + KS_LANES - 1) / KS_LANES * KS_LANES;
  s.pair_s = ORB_NEW(ctx, float, 2 * (size_t)s.padded_count);
  if (!s.pair_s) {
    orb_free(ctx, s.pair);
    return ORB_E_NO_MEMORY;
  }
  s.pair_t = s.pair_s + s.padded_count;
  for (int32_t i = 0; i < s.padded_count; i++) {
    s.pair_s[i] = i < s.pair_count ? (float)s.pair[i][0] : 1;
    s.pair_t[i] = i < s.pair_count ? (float)s.pair[i][1] : 1;
  }
  s.cpu = orb_context_cpu(ctx);
  *out = s;
  return ORB_OK;
}

static void ring_free(orb_context *ctx, orb_ks_ring *r) {
  orb_free(ctx, r->point);
  orb_free(ctx, r->plane);
  orb_free(ctx, r->side);
  orb_free(ctx, r->vertex);
  memset(r, 0, sizeof *r);
}

void orb_ks_sampler_free(orb_context *ctx, orb_ks_sampler *s) {
  ring_free(ctx, &s->ring);
  orb_free(ctx, s->pair);
  orb_free(ctx, s->pair_s);
  orb_free(ctx, s->near_candidate);
  orb_free(ctx, s->edge);
  orb_free(ctx, s->candidate);
  memset(s, 0, sizeof *s);
}

static orb_status ring_reserve(orb_context *ctx, orb_ks_sampler *s, int32_t count) {
  orb_ks_ring *r = &s->ring;
  if (count <= r->capacity) {
    return ORB_OK;
  }
  size_t capacity = (size_t)count + (size_t)count / 2 + 16;
  ring_free(ctx, r);
  orb_free(ctx, s->candidate);
  orb_free(ctx, s->near_candidate);
  orb_free(ctx, s->edge);
  s->room = (int32_t)(capacity < KS_WHOLE_RING ? capacity : KS_WHOLE_RING) * s->padded_count + KS_LANES;
  s->candidate = orb_alloc(ctx, (size_t)s->room, 4 * sizeof(double));
  s->near_candidate = orb_alloc(ctx, (size_t)s->room, 4 * sizeof(float));
  s->edge = ORB_NEW(ctx, orb_ks_edge, capacity);
  r->point = orb_alloc(ctx, capacity, sizeof *r->point);
  r->plane = orb_alloc(ctx, capacity, sizeof *r->plane);
  r->side = ORB_NEW(ctx, double, 6 * capacity);
  r->vertex = ORB_NEW(ctx, int32_t, capacity);
  if (!s->candidate || !s->near_candidate || !s->edge || !r->point || !r->plane || !r->side || !r->vertex) {
    return ORB_E_NO_MEMORY;
  }
  r->side2 = r->side + capacity;
  r->angle_p = r->side + 2 * capacity;
  r->angle_q = r->side + 3 * capacity;
  r->angle_r = r->side + 4 * capacity;
  r->inverse_area = r->side + 5 * capacity;
  r->capacity = (int32_t)capacity;
  return ORB_OK;
}

int32_t orb_ks_stride(const orb_ks_sampler *s, int32_t ring_count) {
  int64_t most = KS_WORK / ((int64_t)s->padded_count * ring_count); /* triangles to be sampled */
  most = most < 8 ? 8 : most > KS_WHOLE_RING ? KS_WHOLE_RING : most;
  return (int32_t)((ring_count + most - 1) / most);
}

orb_status orb_ks_ring_load(orb_context *ctx, orb_ks_sampler *s, const orb_ks_mesh *m, const double *P, int32_t v) {
  ORB_TRY(ring_reserve(ctx, s, m->valence[v]));
  orb_ks_ring *r = &s->ring;
  r->count = 0;
  double area_floor = AREA_FLOOR * 4 * M_PI / (2 * m->live - 4);
  int32_t e = m->out[v];
  do {
    int32_t w = orb_ks_head(m, e);
    r->vertex[r->count] = w;
    memcpy(r->point[r->count++], P + 3 * (size_t)w, 3 * sizeof(double));
    e = orb_ks_rotate(m, e);
  } while (e != m->out[v]);
  const double *xp = m->x + 3 * (size_t)v;
  double mesh_area = 0, fan_area = 0;
  for (int32_t i = 0; i < r->count; i++, e = orb_ks_rotate(m, e)) {
    int32_t j = i + 1 < r->count ? i + 1 : 0;
    double d[3], u[3], w[3], n[3];
    orb_sub(r->point[j], r->point[i], d);
    orb_cross(r->point[i], d, r->plane[i]);
    r->side2[i] = orb_dot(d, d);
    r->side[i] = sqrt(r->side2[i]);
    orb_sub(m->x + 3 * (size_t)r->vertex[i], xp, u);
    orb_sub(m->x + 3 * (size_t)r->vertex[j], xp, w);
    orb_cross(u, w, n);
    double area = 0.5 * orb_length(n), half = 0.5 / (area > area_floor ? area : area_floor);
    orb_sub(w, u, n);
    r->angle_p[i] = (orb_dot(n, n) + area_floor) * half;
    r->angle_q[i] = (orb_dot(w, w) + area_floor) * half;
    r->angle_r[i] = (orb_dot(u, u) + area_floor) * half;
    double carried = m->area[e / 3];
    r->inverse_area[i] = 1 / carried;
    mesh_area += carried;
    double spoke[3], normal[3];
    orb_sub(r->point[i], r->point[0], spoke);
    orb_cross(spoke, d, normal);
    fan_area += 0.5 * orb_length(normal);
  }
  r->fill = fan_area / mesh_area;
  int squeezed = r->fill < SQUEEZED;
  r->aspect_exponent = squeezed && s->aspect_exponent > 1 ? 1 : s->aspect_exponent;
  return ORB_OK;
}

enum { LANES = 64 }; /* candidates of a batch */

/* Raises each x to the power e; whole and half powers up to 64 by multiplication, bit by bit over all lanes, so that
 * each pass is a plain vector loop. */
static inline __attribute__((always_inline)) void raise_each(double *x, int32_t count, double e) {
  double doubled = 2 * e, power[LANES];
  if (doubled != floor(doubled) || doubled < 0 || doubled > 128) {
    for (int32_t l = 0; l < count; l++) {
      x[l] = pow(x[l], e);
    }
    return;
  }
  int bits = (int)doubled;
  for (int32_t l = 0; l < count; l++) {
    power[l] = 1;
  }
  if (bits & 1) {
    for (int32_t l = 0; l < count; l++) {
      power[l] = sqrt(x[l]);
    }
  }
  for (int b = bits >> 1; b; b >>= 1) {
    if (b & 1) {
      for (int32_t l = 0; l < count; l++) {
        power[l] *= x[l];
      }
    }
    for (int32_t l = 0; l < count; l++) {
      x[l] *= x[l];
    }
  }
  memcpy(x, power, (size_t)count * sizeof *x);
}

/* The spokes from a batch of candidates to one neighbour: difference, length and its square. */
typedef struct spokes {
  double x[LANES], y[LANES], z[LANES], square[LANES], length[LANES];
} spokes;

static inline __attribute__((always_inline)) void measure_spokes(const double *q, const double *x, const double *y,
                                                                 const double *z, int32_t count, spokes *out) {
  for (int32_t l = 0; l < count; l++) {
    double ux = q[0] - x[l], uy = q[1] - y[l], uz = q[2] - z[l], square = ux * ux + uy * uy + uz * uz;
    out->x[l] = ux;
    out->y[l] = uy;
    out->z[l] = uz;
    out->square[l] = square;
    out->length[l] = sqrt(square);
  }
}

/* Adds the term of Eq. 3 for the ring triangle between spokes u and w; returns the least error so far. */
static inline __attribute__((always_inline)) double add_term(const orb_ks_ring *r, int32_t i, double area_exponent,
                                                             double aspect_exponent, const spokes *u, const spokes *w,
                                                             int32_t count, double *error) {
  double a = r->side[i], a2 = r->side2[i], mp = r->angle_p[i], mq = r->angle_q[i], mr = r->angle_r[i];
  double inverse = 0.5 * r->inverse_area[i], least = INFINITY, angle[LANES], area[LANES], shape[LANES];
  for (int32_t l = 0; l < count; l++) {
    double nx = u->y[l] * w->z[l] - u->z[l] * w->y[l], ny = u->z[l] * w->x[l] - u->x[l] * w->z[l];
    double nz = u->x[l] * w->y[l] - u->y[l] * w->x[l], n2 = nx * nx + ny * ny + nz * nz + ORB_TINY;
    double c2 = u->square[l], b2 = w->square[l], b = w->length[l], c = u->length[l], inv = 1 / n2;
    double doubled = sqrt(n2);
    angle[l] = 0.5 * (mp * (b2 + c2 - a2) + mq * (a2 + c2 - b2) + mr * (a2 + b2 - c2)) * doubled * inv;
    double ratio = doubled * inverse;
    area[l] = ratio + 1 / ratio;
    shape[l] = 0.25 * a * b * c * (a + b + c) * inv;
  }
  raise_each(area, count, area_exponent);
  raise_each(shape, count, aspect_exponent);
  for (int32_t l = 0; l < count; l++) {
    error[l] += angle[l] * area[l] * shape[l];
  }
  for (int32_t l = 0; l < count; l++) {
    least = error[l] < least ? error[l] : least;
  }
  return least;
}

/* Eq. 3 for `count` ≤ LANES candidates. Its terms are positive, so it stops once all sums are above `bound`. */
ORB_CLONES static void measure_batch(const orb_ks_ring *r, double area_exponent, double aspect_exponent,
                                     const double *x, const double *y, const double *z, int32_t count, double bound,
                                     double *error) {
  spokes first, pair[2];
  memset(error, 0, (size_t)count * sizeof *error);
  measure_spokes(r->point[0], x, y, z, count, &first);
  const spokes *u = &first;
  for (int32_t i = 0; i < r->count; i++) {
    const spokes *w = &first;
    if (i + 1 < r->count) {
      measure_spokes(r->point[i + 1], x, y, z, count, &pair[i & 1]);
      w = &pair[i & 1];
    }
    if (add_term(r, i, area_exponent, aspect_exponent, u, w, count, error) >= bound) {
      return;
    }
    u = w;
  }
}

/* The smallest signed distance of each candidate to the ring's planes, unscaled. */
ORB_CLONES static void clip(const orb_ks_ring *r, const double *x, const double *y, const double *z, int32_t count,
                            double *least) {
  for (int32_t l = 0; l < count; l++) {
    least[l] = INFINITY;
  }
  for (int32_t i = 0; i < r->count; i++) {
    const double *n = r->plane[i], *q = r->point[i];
    for (int32_t l = 0; l < count; l++) {
      double d = n[0] * (x[l] - q[0]) + n[1] * (y[l] - q[1]) + n[2] * (z[l] - q[2]);
      least[l] = d < least[l] ? d : least[l];
    }
  }
}

/* The points of Eq. 2 in the triangle (apex, q, w), pulled towards the apex by `draw`, on the sphere. */
ORB_CLONES static void spread(const double (*pair)[2], int32_t pairs, double draw, const double *apex, const double *q,
                              const double *w, double *x, double *y, double *z) {
  double qx = draw * (q[0] - apex[0]), qy = draw * (q[1] - apex[1]), qz = draw * (q[2] - apex[2]);
  double wx = draw * (w[0] - apex[0]), wy = draw * (w[1] - apex[1]), wz = draw * (w[2] - apex[2]);
  for (int32_t l = 0; l < pairs; l++) {
    double s = pair[l][0], t = pair[l][1];
    double px = apex[0] + s * qx + t * wx, py = apex[1] + s * qy + t * wy, pz = apex[2] + s * qz + t * wz;
    double f = 1 / sqrt(px * px + py * py + pz * pz + ORB_TINY);
    x[l] = px * f;
    y[l] = py * f;
    z[l] = pz * f;
  }
}

/* x to the power e, whole powers up to 64 by multiplication. */
static double raise(double x, double e) {
  if (e != floor(e) || e < 0 || e > 64) {
    return pow(x, e);
  }
  double result = 1;
  for (int bits = (int)e; bits; bits >>= 1, x *= x) {
    result *= bits & 1 ? x : 1;
  }
  return result;
}

double orb_ks_error_at(const orb_ks_sampler *s, const double p[3]) {
  const orb_ks_ring *r = &s->ring;
  double error = 0, u[3], w[3], n[3];
  orb_sub(r->point[0], p, u);
  double c2 = orb_dot(u, u), c = sqrt(c2);
  for (int32_t i = 0; i < r->count; i++) {
    double a = r->side[i], a2 = r->side2[i], mp = r->angle_p[i], mq = r->angle_q[i], mr = r->angle_r[i];
    orb_sub(r->point[i + 1 < r->count ? i + 1 : 0], p, w);
    orb_cross(u, w, n);
    double n2 = orb_dot(n, n) + ORB_TINY, doubled = sqrt(n2), b2 = orb_dot(w, w), b = sqrt(b2);
    double angle = 0.5 * (mp * (b2 + c2 - a2) + mq * (a2 + c2 - b2) + mr * (a2 + b2 - c2)) / doubled;
    double ratio = 0.5 * r->inverse_area[i] * doubled;
    error += angle * raise(ratio + 1 / ratio, s->area_exponent) *
             raise(0.25 * a * b * c * (a + b + c) / n2, r->aspect_exponent);
    memcpy(u, w, sizeof u);
    c2 = b2;
    c = b;
  }
  return error;
}

/* Keeps the candidates that lie above all planes; returns how many. */
static int32_t keep_inside(orb_ks_sampler *s, double *x, double *y, double *z, int32_t count) {
  int32_t kept = 0;
  double least[LANES];
  for (int32_t begin = 0; begin < count; begin += LANES) {
    int32_t n = count - begin < LANES ? count - begin : LANES;
    clip(&s->ring, x + begin, y + begin, z + begin, n, least);
    for (int32_t l = 0; l < n; l++) {
      x[kept] = x[begin + l];
      y[kept] = y[begin + l];
      z[kept] = z[begin + l];
      kept += least[l] > 0;
    }
  }
  return kept;
}

int orb_ks_best_sample(orb_ks_sampler *s, const double apex[3], int32_t first, int32_t last, double draw, double bound,
                       double out[3], double *error) {
  double *x = s->candidate, *y = x + s->room, *z = y + s->room, *e = z + s->room;
  int32_t count = 0;
  double best_error = bound;
  int32_t stride = orb_ks_stride(s, s->ring.count);
  for (int32_t i = first; i < last; i += stride, count += s->pair_count) {
    spread((const double(*)[2])s->pair, s->pair_count, draw, apex, s->ring.point[i],
           s->ring.point[i + 1 < s->ring.count ? i + 1 : 0], x + count, y + count, z + count);
  }
  count = keep_inside(s, x, y, z, count);
  s->kernel_points = count;
  for (int32_t begin = 0; begin < count; begin += LANES) {
    int32_t n = count - begin < LANES ? count - begin : LANES;
    measure_batch(&s->ring, s->area_exponent, s->ring.aspect_exponent, x + begin, y + begin, z + begin, n, best_error,
                  e + begin);
    for (int32_t l = 0; l < n; l++) {
      best_error = e[begin + l] < best_error ? e[begin + l] : best_error;
    }
  }
  /* The best candidate whose signs hold exactly: almost always the first one tried. */
  for (;;) {
    int32_t best = -1;
    double least = bound;
    for (int32_t l = 0; l < count; l++) {
      if (e[l] < least) {
        least = e[l];
        best = l;
      }
    }
    if (best < 0) {
      return 0;
    }
    const double p[3] = {x[best], y[best], z[best]};
    if (orb_kernel_contains((const double(*)[3])s->ring.point, s->ring.count, p)) {
      memcpy(out, p, sizeof p);
      *error = least;
      return 1;
    }
    e[best] = INFINITY;
  }
}
