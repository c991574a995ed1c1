/* Why floats for most targets: the delta of two unit vectors is up to 2 long, but glTF has only integers up to 1 for
 * it, and its base must have length 1. A target takes integers if no delta of it has a larger component, so if no
 * normal rotates far. Compressed, floats of few digits are no larger than such integers. The filter EXPONENTIAL stores
 * a float as mantissa · 2^exponent in four bytes: a mantissa of eight bits, placed in its topmost byte, leaves two
 * bytes zero, which cost next to nothing.
 *
 * The bound. Let a and b be a normal of the floats on the base and at full weight, e and f the errors of the decoded
 * ones. At weight w the normal is n(w) = (1 − w)·a + w·b and its error (1 − w)·e + w·f, so the sine of the angle
 * between them is at most the quotient of their lengths. Its square is a quotient of two quadratic polynomials in w,
 * whose maximum on 0 … 1 is at an end or at a root of a quadratic equation. */
#include "profile/normal.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "format/gltf_write.h"
#include "profile/codec.h"

enum { BYTE = 5120, SHORT = 5122, BYTE_STRIDE = 4, SHORT_STRIDE = 8, FLOAT_STRIDE = 12, CHECK_EVERY = 4096 };

/* Sine of the largest angle: 0.97°, which leaves room for the rounding of a renderer. */
static const double MOST = 0.016929;
/* Decoders may round a normal of the filter OCTAHEDRAL up or down by one unit in each coordinate. */
static const double OCTAHEDRAL_SLACK = 1.7320508 / 32767;

/* How the base is stored. The first for which every vertex keeps the bound is taken; the later ones serve normals that
 * rotate by nearly 180°, where n(w) nearly vanishes. BYTES or OCTAHEDRAL_9 is the first, the smaller of the two without
 * and with compression. */
typedef enum precision { BYTES = 0, OCTAHEDRAL_9, OCTAHEDRAL_13, DIGITS_24, EXACT, PRECISIONS } precision;

/* How far from 1 the length of a normal in bytes may be. Validators accept 0.00674. */
static const double LENGTH_SLACK = 0.0066;

/* Exponents of the filter: values below 1 and below 2 in 24 bits with a sign. */
enum { BELOW_ONE = -23, BELOW_TWO = -22 };

/* Rounds to a multiple of 2^-bits that the filter EXPONENTIAL can store. exponent: the least one to use; with
 * BELOW_TWO, or from 1 on, a multiple of 2^(1-bits). bits ≤ 23. */
static float digits(double value, int bits, int exponent, uint32_t *stored) {
  exponent = fabs(value) < 1 - ldexp(0.5, -bits) ? exponent : BELOW_TWO;
  int shift = 23 - bits;
  double most = ldexp(1, bits) - 1, mantissa = floor(ldexp(value, -exponent - shift) + 0.5);
  mantissa = mantissa > most ? most : mantissa < -most ? -most : mantissa;
  int32_t whole = (int32_t)mantissa * (int32_t)(1u << shift);
  *stored = (uint32_t)exponent << 24 | ((uint32_t)whole & 0xffffff);
  return (float)ldexp((double)whole, exponent);
}

static double dot(const double a[3], const double b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* The coefficients of |p + w·(q − p)|². */
static void square_of(const double p[3], const double q[3], double out[3]) {
  double way[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]};
  out[0] = dot(p, p);
  out[1] = 2 * dot(p, way);
  out[2] = dot(way, way);
}

static double at(const double c[3], double w) {
  double value = c[0] + w * (c[1] + w * c[2]);
  return value > 0 ? value : 0;
}

/* The quotient E(w) / N(w); 0 / 0 is 0, because the error vanishes with the normal. */
static double quotient(const double e[3], const double n[3], double w) {
  double error = at(e, w), normal = at(n, w);
  return error == 0 ? 0 : normal > 0 ? error / normal : INFINITY;
}

/* The largest value of |(1 − w)·e + w·f| / |(1 − w)·a + w·b| for w in 0 … 1. */
static double worst_quotient(const double a[3], const double b[3], const double e[3], const double f[3]) {
  double n[3], r[3];
  square_of(a, b, n);
  square_of(e, f, r);
  double most = fmax(quotient(r, n, 0), quotient(r, n, 1));
  /* The derivative is 0 where c0 + c1·w + c2·w² = 0; its cubic terms cancel. */
  double c0 = r[1] * n[0] - r[0] * n[1], c1 = 2 * (r[2] * n[0] - r[0] * n[2]), c2 = r[2] * n[1] - r[1] * n[2];
  double inside = c1 * c1 - 4 * c0 * c2;
  if (inside >= 0) {
    double half = -0.5 * (c1 + (c1 < 0 ? -1 : 1) * sqrt(inside));
    double roots[2] = {c2 != 0 ? half / c2 : -1, half != 0 ? c0 / half : -1};
    for (int i = 0; i < 2; i++) {
      if (roots[i] > 0 && roots[i] < 1) {
        most = fmax(most, quotient(r, n, roots[i]));
      }
    }
  }
  return sqrt(most);
}

/* The length of the shortest n(w). */
static double shortest(const double a[3], const double b[3]) {
  double n[3];
  square_of(a, b, n);
  double w = n[2] > 0 ? -n[1] / (2 * n[2]) : 0;
  return sqrt(at(n, w < 0 ? 0 : w > 1 ? 1 : w));
}

/* The bound of one vertex and target. */
static double bound_of(const double a[3], const double b[3], const double e[3], const double f[3], double slack) {
  double quick = (sqrt(fmax(dot(e, e), dot(f, f))) + slack), least = shortest(a, b);
  if (slack == 0 && quick == 0) {
    return 0;
  }
  return least * MOST > 1.5 * quick ? quick / least /* above the true maximum, and small */
                                    : worst_quotient(a, b, e, f) + (slack > 0 ? slack / least : 0);
}

typedef struct encoder {
  orb_context *ctx;
  const float *base;
  int32_t count;
  int compressed;
  double slack;
  float *shown; /* the decoded base, 3 per vertex */
} encoder;

static orb_status encode_octahedra(encoder *self, int bits, orb_stream *out) {
  *out = (orb_stream){.count = self->count,
                      .stride = SHORT_STRIDE,
                      .components = 3,
                      .component_type = SHORT,
                      .normalized = 1,
                      .filter = ORB_FILTER_OCTAHEDRAL};
  ORB_TRY(orb_stream_allocate(self->ctx, out, 1));
  float *padded = ORB_NEW0(self->ctx, float, 4 * (size_t)self->count);
  if (!padded) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < self->count; i++) {
    memcpy(padded + 4 * (size_t)i, self->base + 3 * (size_t)i, 3 * sizeof(float));
  }
  orb_codec_octahedra(padded, self->count, bits, (int16_t *)(void *)out->stored, (int16_t *)(void *)out->bytes);
  orb_free(self->ctx, padded);
  const int16_t *values = (const int16_t *)(const void *)out->bytes;
  for (size_t i = 0; i < 3 * (size_t)self->count; i++) {
    self->shown[i] = (float)values[4 * (i / 3) + i % 3] / 32767.0f;
  }
  self->slack = OCTAHEDRAL_SLACK;
  return ORB_OK;
}

static orb_status begin_integers(orb_context *ctx, int32_t count, int type, orb_stream *out) {
  *out = (orb_stream){.count = count,
                      .stride = type == BYTE ? BYTE_STRIDE : SHORT_STRIDE,
                      .components = 3,
                      .component_type = type,
                      .normalized = 1};
  return orb_stream_allocate(ctx, out, 0);
}

/* The bytes of a unit vector: of the eight points of the grid around it the nearest whose length is nearly 1. */
static void round_to_bytes(const float unit[3], signed char out[3]) {
  double least = INFINITY;
  for (int corner = 0; corner < 8; corner++) {
    double v[3], error = 0, square = 0;
    for (int c = 0; c < 3; c++) {
      double below = floor(127 * (double)unit[c]);
      v[c] = fmin(fmax(below + (corner >> c & 1), -127), 127) / 127;
      error += (v[c] - (double)unit[c]) * (v[c] - (double)unit[c]);
      square += v[c] * v[c];
    }
    double off = fabs(sqrt(square) - 1);
    error += off > LENGTH_SLACK ? 1 + off : 0;
    if (error < least) {
      least = error;
      for (int c = 0; c < 3; c++) {
        out[c] = (signed char)lrint(127 * v[c]);
      }
    }
  }
}

static orb_status encode_bytes(encoder *self, orb_stream *out) {
  ORB_TRY(begin_integers(self->ctx, self->count, BYTE, out));
  signed char *bytes = (signed char *)out->bytes;
  for (size_t i = 0; i < (size_t)self->count; i++) {
    round_to_bytes(self->base + 3 * i, bytes + BYTE_STRIDE * i);
    for (size_t c = 0; c < 3; c++) {
      self->shown[3 * i + c] = (float)bytes[BYTE_STRIDE * i + c] / 127.0f;
    }
  }
  self->slack = 0;
  return ORB_OK;
}

static orb_status begin_floats(orb_context *ctx, int32_t count, int filtered, orb_stream *out) {
  *out = (orb_stream){.count = count,
                      .stride = FLOAT_STRIDE,
                      .components = 3,
                      .component_type = ORB_GLTF_FLOAT,
                      .filter = filtered ? ORB_FILTER_EXPONENTIAL : ORB_FILTER_NONE};
  return orb_stream_allocate(ctx, out, filtered);
}

/* The base as floats. With digits, each vertex gets as many as all targets need: 15, or 23. */
static orb_status encode_floats(encoder *self, int filtered, orb_stream *out) {
  ORB_TRY(begin_floats(self->ctx, self->count, filtered, out));
  uint32_t *stored = (uint32_t *)(void *)out->stored;
  for (size_t i = 0; i < 3 * (size_t)self->count; i++) {
    self->shown[i] = filtered ? digits((double)self->base[i], 23, BELOW_ONE, &stored[i]) : self->base[i];
  }
  memcpy(out->bytes, self->shown, 3 * (size_t)self->count * sizeof(float));
  self->slack = 0;
  return ORB_OK;
}

/* Stores the delta of a vertex with this many digits, aimed at `goal` from what the base shows. Returns the bound. */
static double try_digits(const encoder *self, size_t i, const double a[3], const double b[3], const double goal[3],
                         int bits, int exponent, float shown[3], uint32_t stored[3]) {
  double e[3], f[3];
  for (size_t c = 0; c < 3; c++) {
    double from = (double)self->shown[3 * i + c];
    shown[c] = digits(goal[c] - from, bits, exponent, &stored[c]);
    e[c] = from - a[c];
    f[c] = from + (double)shown[c] - b[c];
  }
  return bound_of(a, b, e, f, self->slack);
}

/* Stores the delta of a vertex as integers, aimed at its end. Returns the bound; infinite if the delta is too large. */
static double encode_integer_delta(const encoder *self, size_t i, const float *deltas, double units, int stored[3]) {
  double a[3], b[3], e[3], f[3];
  for (size_t c = 0; c < 3; c++) {
    double from = (double)self->shown[3 * i + c];
    a[c] = (double)self->base[3 * i + c];
    b[c] = a[c] + (double)deltas[3 * i + c];
    double value = floor(units * (b[c] - from) + 0.5);
    if (fabs(value) > units) {
      return INFINITY;
    }
    stored[c] = (int)value;
    e[c] = from - a[c];
    f[c] = from + value / units - b[c];
  }
  return bound_of(a, b, e, f, self->slack);
}

/* One target as integers. Leaves no stream if a vertex breaks the bound or does not fit. */
static orb_status encode_integers(const encoder *self, const float *deltas, int type, orb_stream *out, double *bound) {
  double most = *bound, units = type == BYTE ? 127 : 32767;
  ORB_TRY(begin_integers(self->ctx, self->count, type, out));
  for (size_t i = 0; i < (size_t)self->count && most <= MOST; i++) {
    int stored[3] = {0};
    most = fmax(most, encode_integer_delta(self, i, deltas, units, stored));
    for (size_t c = 0; c < 3; c++) {
      if (type == BYTE) {
        out->bytes[BYTE_STRIDE * i + c] = (unsigned char)stored[c];
      } else {
        ((int16_t *)(void *)out->bytes)[SHORT_STRIDE / 2 * i + c] = (int16_t)stored[c];
      }
    }
    if (i % CHECK_EVERY == 0) {
      ORB_TRY(orb_context_check(self->ctx));
    }
  }
  if (most > MOST) {
    orb_stream_free(self->ctx, out);
  } else {
    *bound = most;
  }
  return ORB_OK;
}

/* The delta of one vertex, with as few digits as the bound allows. Returns the bound. */
static double encode_delta(const encoder *self, size_t i, const float *deltas, int exponent, float shown[3],
                           uint32_t stored[3]) {
  static const int bits[] = {7, 15, 23};
  double a[3], b[3], mirrored[3], bound = INFINITY;
  for (size_t c = 0; c < 3; c++) {
    a[c] = (double)self->base[3 * i + c];
    b[c] = a[c] + (double)deltas[3 * i + c];
    mirrored[c] = b[c] + a[c] - (double)self->shown[3 * i + c]; /* opposite errors cancel halfway */
  }
  for (size_t k = self->compressed ? 0 : 2; k < sizeof bits / sizeof bits[0]; k++) {
    bound = try_digits(self, i, a, b, b, bits[k], exponent, shown, stored);
    if (bound > MOST && k > 0) {
      bound = try_digits(self, i, a, b, mirrored, bits[k], exponent, shown, stored);
    }
    if (bound <= MOST) {
      break;
    }
  }
  return bound;
}

/* The exponent that most values of a target share. The compression predicts each byte from that of the vertex before,
 * sixteen vertices at a time; where a large value is in every fourth of these groups, it is better that all have its
 * exponent than that exponents change. */
static int common_exponent(const float *deltas, int32_t count) {
  enum { GROUP = 16, RARE = 4 };
  int32_t large = 0, groups = (count + GROUP - 1) / GROUP;
  for (int32_t g = 0; g < groups; g++) {
    int found = 0;
    for (size_t i = 3 * GROUP * (size_t)g; i < 3 * (size_t)count && i < 3 * GROUP * (size_t)(g + 1); i++) {
      found |= fabsf(deltas[i]) >= 1;
    }
    large += found;
  }
  return RARE * (int64_t)large > groups ? BELOW_TWO : BELOW_ONE;
}

/* One target. *bound: raised; above MOST where a vertex needs a finer base. */
static orb_status encode_target(const encoder *self, const float *deltas, int exact, orb_stream *out, double *bound) {
  for (int type = BYTE; !self->compressed && !exact && type <= SHORT; type += SHORT - BYTE) {
    ORB_TRY(encode_integers(self, deltas, type, out, bound));
    if (out->bytes) {
      return ORB_OK;
    }
  }
  ORB_TRY(begin_floats(self->ctx, self->count, !exact, out));
  if (exact) {
    memcpy(out->bytes, deltas, 3 * (size_t)self->count * sizeof(float));
    return ORB_OK;
  }
  int exponent = common_exponent(deltas, self->count);
  for (int32_t i = 0; i < self->count && *bound <= MOST; i++) {
    size_t place = 3 * (size_t)i;
    double own = encode_delta(self, (size_t)i, deltas, exponent, (float *)(void *)out->bytes + place,
                              (uint32_t *)(void *)out->stored + place);
    *bound = own > *bound ? own : *bound;
    if (i % CHECK_EVERY == 0) {
      ORB_TRY(orb_context_check(self->ctx));
    }
  }
  return ORB_OK;
}

/* The bound of the base alone. */
static double base_bound(const encoder *self) {
  double most = 0;
  for (size_t i = 0; i < (size_t)self->count; i++) {
    double a[3], e[3];
    for (size_t c = 0; c < 3; c++) {
      a[c] = (double)self->base[3 * i + c];
      e[c] = (double)self->shown[3 * i + c] - a[c];
    }
    most = fmax(most, bound_of(a, a, e, e, self->slack));
  }
  return most;
}

static orb_status encode_all(encoder *self, precision level, const float *const *deltas, int32_t target_count,
                             orb_stream *base_stream, orb_stream *targets, double *bound) {
  *bound = 0;
  if (level == BYTES) {
    ORB_TRY(encode_bytes(self, base_stream));
  } else if (level <= OCTAHEDRAL_13) {
    ORB_TRY(encode_octahedra(self, level == OCTAHEDRAL_9 ? 9 : 13, base_stream));
  } else {
    ORB_TRY(encode_floats(self, level == DIGITS_24, base_stream));
  }
  if (level != EXACT) {
    *bound = base_bound(self);
  }
  for (int32_t k = 0; k < target_count && *bound <= MOST; k++) {
    ORB_TRY(encode_target(self, deltas[k], level == EXACT, &targets[k], bound));
  }
  return ORB_OK;
}

orb_status orb_normals_encode(orb_context *ctx, const float *base, int32_t count, const float *const *deltas,
                              int32_t target_count, int compressed, orb_stream *base_stream, orb_stream *targets,
                              double *degrees) {
  encoder self = {.ctx = ctx,
                  .base = base,
                  .count = count,
                  .compressed = compressed,
                  .shown = ORB_NEW(ctx, float, 3 * (size_t)count)};
  orb_status status = self.shown ? ORB_OK : ORB_E_NO_MEMORY;
  double bound = INFINITY;
  for (int level = compressed ? OCTAHEDRAL_9 : BYTES; status == ORB_OK && level < PRECISIONS && bound > MOST; level++) {
    orb_stream_free(ctx, base_stream);
    for (int32_t k = 0; k < target_count; k++) {
      orb_stream_free(ctx, &targets[k]);
    }
    status = encode_all(&self, (precision)level, deltas, target_count, base_stream, targets, &bound);
  }
  if (status == ORB_OK) {
    *degrees = fmax(*degrees, asin(bound < 1 ? bound : 1) * 180 / 3.14159265358979323846);
  }
  orb_free(ctx, self.shown);
  return status;
}
