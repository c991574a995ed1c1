/* How much a map of triangles distorts.
 *
 * With U, W two edges of a source triangle, u, w their images and c the ratio of the whole areas, the linear map has
 * σ₁² + σ₂² = (u²W² + w²U² − 2 (u·w)(U·W)) / |U×W|² / c and σ₁σ₂ = |u×w| / |U×W| / c; all measures follow from the two.
 *
 * Percentiles need no full sort: weights are summed in fine bins (1/1024 of an octave, or of a unit for the logarithm
 * of area), and only the values of the bin that holds the percentile are sorted. The published histogram joins fine
 * bins. Sums are taken chunk by chunk in a fixed order, so the number of threads changes no bit.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/check.h"
#include "base/loops.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/vec3.h"
#include "orbmorph/embed.h"

enum { DIRICHLET = 0, ANGLE, AREA, ASPECT, MEASURES };
enum {
  GRAIN = 4096,  /* triangles of a chunk */
  FINE = 1 << 16 /* fine bins: 64 octaves, or logarithms of area from −32 to 32; the outermost take the rest */
};

static const double ZERO_AREA = 1e-13; /* an area is rounding while |U×W| / (U² + W²) is at most this */
static const double LARGEST = 1e300;   /* stands for infinite values, so that sums stay finite */

typedef struct moments {
  double weight, mean, square; /* square: Σ w (x − mean)² */
  double least, most;
} moments;

typedef struct measure_chunk {
  double source_area, image_area;
  moments of[MEASURES];
  double stretch;
} measure_chunk;

typedef struct measure_job {
  orb_context *ctx;
  const double *positions, *images;
  const int32_t *triangles;
  int32_t count;
  double unit;  /* source lengths are multiplied by it */
  double ratio; /* image area over source area */
  double *weight, *value[MEASURES];
  measure_chunk *chunk;
  moments total[MEASURES];
  orb_measure *out[MEASURES];
  atomic_int status;
} measure_job;

typedef struct pair {
  double uu, ww, uw, doubled;
} pair;

static pair edges_of(const double *points, const int32_t *v, double unit, double *third2) {
  const double *a = points + 3 * (int64_t)v[0], *b = points + 3 * (int64_t)v[1], *c = points + 3 * (int64_t)v[2];
  double u[3], w[3], n[3];
  for (int k = 0; k < 3; k++) {
    u[k] = (b[k] - a[k]) * unit;
    w[k] = (c[k] - a[k]) * unit;
  }
  orb_cross(u, w, n);
  if (third2) {
    *third2 = orb_distance2(u, w);
  }
  return (pair){.uu = orb_dot(u, u), .ww = orb_dot(w, w), .uw = orb_dot(u, w), .doubled = orb_length(n)};
}

static void sum_areas(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  measure_job *job = arg;
  measure_chunk *out = &job->chunk[begin / GRAIN];
  out->source_area = out->image_area = 0;
  for (int64_t t = begin; t < end; t++) {
    pair source = edges_of(job->positions, job->triangles + 3 * t, job->unit, NULL);
    int counts = source.doubled > ZERO_AREA * (source.uu + source.ww);
    job->weight[t] = counts ? 0.5 * source.doubled : 0;
    out->source_area += job->weight[t];
    out->image_area += 0.5 * edges_of(job->images, job->triangles + 3 * t, 1, NULL).doubled;
  }
}

/* The values of one triangle; returns its ½(σ₁⁻² + σ₂⁻²). */
static double measure_triangle(measure_job *job, int64_t t) {
  double third2;
  pair s = edges_of(job->positions, job->triangles + 3 * t, job->unit, NULL);
  pair i = edges_of(job->images, job->triangles + 3 * t, 1, &third2);
  double squares = (i.uu * s.ww + i.ww * s.uu - 2 * i.uw * s.uw) / (s.doubled * s.doubled) / job->ratio;
  double det = i.doubled / s.doubled / job->ratio, h = squares / det - 2, inverse = squares / (det * det);
  h = h > 0 ? h : 0;
  job->value[DIRICHLET][t] = 0.25 * (squares + inverse);
  job->value[ANGLE][t] = 1 + 0.5 * (h + sqrt(h * (h + 4)));
  job->value[AREA][t] = log(det);
  double a = sqrt(i.uu), b = sqrt(i.ww), c = sqrt(third2);
  job->value[ASPECT][t] = a * b * c * (a + b + c) / (4 * i.doubled * i.doubled);
  return 0.5 * inverse;
}

static moments moments_of(const double *value, const double *weight, int64_t begin, int64_t end) {
  moments m = {.least = INFINITY, .most = -INFINITY};
  double sum = 0;
  for (int64_t t = begin; t < end; t++) {
    if (weight[t] > 0) {
      m.weight += weight[t];
      sum += weight[t] * value[t];
      m.least = value[t] < m.least ? value[t] : m.least;
      m.most = value[t] > m.most ? value[t] : m.most;
    }
  }
  m.mean = m.weight > 0 ? sum / m.weight : 0;
  for (int64_t t = begin; t < end; t++) {
    m.square += weight[t] > 0 ? weight[t] * (value[t] - m.mean) * (value[t] - m.mean) : 0;
  }
  return m;
}

/* Chan, Golub & LeVeque 1979. */
static void join_moments(moments *a, const moments *b) {
  if (b->weight > 0) {
    double both = a->weight + b->weight, apart = b->mean - a->mean;
    a->mean += apart * b->weight / both;
    a->square += b->square + apart * apart * a->weight * b->weight / both;
    a->weight = both;
    a->least = fmin(a->least, b->least);
    a->most = fmax(a->most, b->most);
  }
}

static double bounded(double x) {
  return x < -LARGEST ? -LARGEST : x < LARGEST ? x : LARGEST; /* NaN too becomes LARGEST */
}

static void measure_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  measure_job *job = arg;
  measure_chunk *out = &job->chunk[begin / GRAIN];
  double stretch = 0;
  for (int64_t t = begin; t < end; t++) {
    if (job->weight[t] > 0) {
      stretch += job->weight[t] * measure_triangle(job, t);
      for (int i = 0; i < MEASURES; i++) {
        job->value[i][t] = bounded(job->value[i][t]);
      }
    }
  }
  out->stretch = stretch;
  for (int i = 0; i < MEASURES; i++) {
    out->of[i] = moments_of(job->value[i], job->weight, begin, end);
  }
}

/* The fine bin of a value, monotone in x. All measures but area are at least 1, so the exponent and the first 10 bits
 * of the mantissa give the bin. */
static int32_t fine_bin(int measure, double x) {
  if (measure == AREA) {
    double at = floor((x + 32) * 1024);
    return at < 0 ? 0 : at < FINE ? (int32_t)at : FINE - 1;
  }
  const double one = 1;
  int64_t bits, base;
  memcpy(&bits, &x, sizeof bits);
  memcpy(&base, &one, sizeof base);
  int64_t at = (bits - base) >> 42;
  return at < 0 ? 0 : at < FINE ? (int32_t)at : FINE - 1;
}

static double fine_edge(int measure, int32_t bin) {
  if (measure == AREA) {
    return bin / 1024.0 - 32;
  }
  const double one = 1;
  int64_t bits;
  memcpy(&bits, &one, sizeof bits);
  bits += (int64_t)bin << 42;
  double x;
  memcpy(&x, &bits, sizeof x);
  return x;
}

/* The fine bins from `low` to `high`: every value lies in one of them. */
typedef struct fine_bins {
  int32_t low, high;
  double *weight, *count;
} fine_bins;

static void publish_histogram(orb_measure *out, int measure, const moments *total, const fine_bins *fine) {
  int32_t low = fine->low, high = fine->high;
  int32_t step = (high - low) / ORB_HISTOGRAM_BINS + 1;
  out->bins = (high - low) / step + 1;
  for (int32_t b = 0; b < out->bins; b++) {
    out->edges[b] = fine_edge(measure, low + b * step);
    for (int32_t i = b * step; i < (b + 1) * step && i <= high - low; i++) {
      out->counts[b] += fine->count[i];
    }
  }
  out->edges[0] = fmin(out->edges[0], total->least);
  out->edges[out->bins] = fmax(fine_edge(measure, low + out->bins * step), total->most);
}

typedef struct weighted {
  double value, weight;
} weighted;

static int compare_weighted(const void *a, const void *b) {
  double x = ((const weighted *)a)->value, y = ((const weighted *)b)->value;
  return (x > y) - (x < y);
}

/* The least value at which the cumulative weight reaches `share` of the total. */
static orb_status percentile(measure_job *job, int measure, const fine_bins *fine, double share, double *out) {
  double want = share * job->total[measure].weight, below = 0;
  int32_t bin = 0;
  while (bin < fine->high - fine->low && below + fine->weight[bin] < want) {
    below += fine->weight[bin++];
  }
  while (fine->count[bin] == 0 && bin > 0) { /* the sum fell short by rounding */
    bin--;
  }
  int64_t room = (int64_t)fine->count[bin], found = 0;
  bin += fine->low;
  weighted *list = ORB_NEW(job->ctx, weighted, room);
  if (!list) {
    return ORB_E_NO_MEMORY;
  }
  for (int64_t t = 0; t < job->count; t++) {
    if (job->weight[t] > 0 && fine_bin(measure, job->value[measure][t]) == bin) {
      list[found++] = (weighted){.value = job->value[measure][t], .weight = job->weight[t]};
    }
  }
  ORB_ASSERT(found == room && room > 0);
  qsort(list, (size_t)found, sizeof *list, compare_weighted);
  int64_t at = 0;
  while (at < found - 1 && below + list[at].weight < want) {
    below += list[at++].weight;
  }
  *out = list[at].value;
  orb_free(job->ctx, list);
  return ORB_OK;
}

static orb_status summarise(measure_job *job, int measure) {
  const moments *total = &job->total[measure];
  orb_measure *out = job->out[measure];
  fine_bins fine = {.low = fine_bin(measure, total->least), .high = fine_bin(measure, total->most)};
  int64_t bins = fine.high - fine.low + 1;
  fine.weight = ORB_NEW0(job->ctx, double, 2 * bins);
  if (!fine.weight) {
    return ORB_E_NO_MEMORY;
  }
  fine.count = fine.weight + bins;
  for (int64_t t = 0; t < job->count; t++) {
    if (job->weight[t] > 0) {
      int32_t bin = fine_bin(measure, job->value[measure][t]) - fine.low;
      fine.weight[bin] += job->weight[t];
      fine.count[bin] += 1;
    }
  }
  out->mean = total->mean;
  out->std = sqrt(total->square / total->weight);
  out->max = total->most;
  publish_histogram(out, measure, total, &fine);
  orb_status status = percentile(job, measure, &fine, 0.5, &out->median);
  if (status == ORB_OK) {
    status = percentile(job, measure, &fine, 0.99, &out->p99);
  }
  orb_free(job->ctx, fine.weight);
  return status;
}

static void summarise_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  measure_job *job = arg;
  for (int64_t i = begin; i < end; i++) {
    orb_status status = summarise(job, (int)i);
    if (status != ORB_OK) {
      atomic_store(&job->status, (int)status);
    }
  }
}

/* The reciprocal of the longest side of the source's bounding box, down to a power of two: in this unit neither tiny
 * nor huge meshes under- or overflow, and scaling rounds nothing. */
static double unit_of(const measure_job *job) {
  double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY}, extent = 0;
  for (int64_t i = 0; i < 3 * (int64_t)job->count; i++) {
    const double *p = job->positions + 3 * (int64_t)job->triangles[i];
    for (int k = 0; k < 3; k++) {
      low[k] = p[k] < low[k] ? p[k] : low[k];
      high[k] = p[k] > high[k] ? p[k] : high[k];
    }
  }
  for (int k = 0; k < 3; k++) {
    extent = fmax(extent, high[k] - low[k]);
  }
  if (!(extent > 0) || !isfinite(extent)) {
    return 1;
  }
  int exponent = ilogb(extent);
  return ldexp(1, exponent < -1000 ? 1000 : -exponent);
}

static orb_status measure_all(measure_job *job, orb_distortion *out) {
  orb_context *ctx = job->ctx;
  int64_t chunks = ((int64_t)job->count + GRAIN - 1) / GRAIN;
  job->unit = unit_of(job);
  ORB_TRY(orb_sliced_for(ctx, job->count, GRAIN, sum_areas, job));
  double source = 0, image = 0, stretch = 0;
  for (int64_t i = 0; i < chunks; i++) {
    source += job->chunk[i].source_area;
    image += job->chunk[i].image_area;
  }
  if (!(source > 0) || !(image > 0)) {
    return ORB_OK; /* nothing has weight: all zero */
  }
  job->ratio = image / source;
  ORB_TRY(orb_sliced_for(ctx, job->count, GRAIN, measure_range, job));
  for (int i = 0; i < MEASURES; i++) {
    job->total[i] = (moments){.least = INFINITY, .most = -INFINITY};
    for (int64_t c = 0; c < chunks; c++) {
      join_moments(&job->total[i], &job->chunk[c].of[i]);
    }
  }
  for (int64_t c = 0; c < chunks; c++) {
    stretch += job->chunk[c].stretch;
  }
  out->stretch_efficiency = source / stretch;
  ORB_TRY(orb_context_check(ctx));
  /* starting threads takes longer than a summary of so few triangles */
  enum { FEW = 16384 };
  orb_parallel_for(ctx, MEASURES, job->count < FEW ? MEASURES : 1, summarise_range, job);
  return (orb_status)atomic_load(&job->status);
}

orb_status orb_distortion_measure(orb_context *ctx, const double *positions, const double *images,
                                  const int32_t *triangles, int32_t triangle_count, orb_distortion *out) {
  memset(out, 0, sizeof *out);
  int64_t n = triangle_count;
  measure_job job = {
      .ctx = ctx, .positions = positions, .images = images, .triangles = triangles, .count = triangle_count};
  job.out[DIRICHLET] = &out->symmetric_dirichlet;
  job.out[ANGLE] = &out->angle;
  job.out[AREA] = &out->area;
  job.out[ASPECT] = &out->aspect;
  job.chunk = ORB_NEW0(ctx, measure_chunk, (n + GRAIN - 1) / GRAIN);
  double *block = ORB_NEW(ctx, double, (MEASURES + 1) * n);
  orb_status status = ORB_E_NO_MEMORY;
  if (job.chunk && block) {
    job.weight = block;
    for (int i = 0; i < MEASURES; i++) {
      job.value[i] = block + (1 + i) * n;
    }
    status = measure_all(&job, out);
  }
  orb_free(ctx, block);
  orb_free(ctx, job.chunk);
  return status;
}
