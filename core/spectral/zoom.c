/* ZoomOut (Melzi et al. 2019) in both directions, which also compares orientation.
 *
 * Each step brings the functions of one shape to the other by the current matrix, takes the nearest sample there for
 * every sample, in both directions, and fits a matrix of more functions to both maps of samples; the nearest orthogonal
 * matrix is the next one. Functions alone do not tell left from right, nor front from back. But the triple product of
 * the normal and the gradients of two functions has one sign on one side and the other sign on the other. So the triple
 * products of the first functions, brought over like the functions and scaled to unit length, are further coordinates.
 * Once the matrix says which side is left, they tell front from back, and no mirror image is found.
 */
#include "spectral/zoom.h"

#include <math.h>
#include <string.h>

#include "base/memory.h"
#include "numeric/clones.h"
#include "numeric/dense.h"

/* Chosen by trial on the pairs of posed people with even numbers (tests/bench/correspond.py --half choose). */
static const int level_size[ORB_ZOOM_LEVELS] = {7, 9, 12, 16, 20, 25, 31};
static const float level_triple[ORB_ZOOM_LEVELS] = {2, 2, 2, 2, 1, 1, 0}; /* weight of the triple products */
static const int level_detail[ORB_ZOOM_LEVELS] = {0, 0, 1, 1, 2, 2, 2};

static const double CONVERGES = 2.5;   /* squared singular value up to which the iteration converges: below 3 */
static const double ORTHOGONAL = 1e-3; /* a matrix times its transpose is nearer than this to the identity */

enum {
  S = ORB_SPECTRAL_SAMPLES,
  K = ORB_SPECTRAL_FUNCTIONS,
  COORDINATES = K + ORB_SPECTRAL_TRIPLES,
  POLAR = 10,      /* most steps to the nearest orthogonal matrix */
  IMAGE_BLOCK = 64 /* vertices that an image is compared with at once */
};

/* Samples of a, brought to b, and samples of b: one is nearest to another by their products. */
typedef struct features {
  int count; /* coordinates */
  float brought[COORDINATES][S], there[COORDINATES][S];
} features;

/* The matrix that takes values at samples to the coefficients of the first `size` functions: weighted least squares. */
static orb_status fit_create(orb_context *ctx, const orb_spectral_shape *shape, int level, double **out) {
  int size = level_size[level], samples = orb_spectral_samples(level_detail[level]);
  const double *share = shape->share[level_detail[level]];
  double gram[K * K] = {0}, *fit = ORB_NEW(ctx, double, (size_t)size *S);
  if (!fit) {
    return ORB_E_NO_MEMORY;
  }
  *out = fit;
  for (int s = 0; s < samples; s++) {
    for (int i = 0; i < size; i++) {
      fit[i * samples + s] = share[s] * shape->at[i][s];
      for (int k = 0; k < size; k++) {
        gram[i * size + k] += fit[i * samples + s] * shape->at[k][s];
      }
    }
  }
  if (orb_dense_solve(size, gram, samples, fit) != 0) {
    memset(fit, 0, (size_t)size * (size_t)samples * sizeof *fit);
  }
  return ORB_OK;
}

orb_status orb_zoom_pair_create(orb_context *ctx, const orb_spectral_shape *a, const orb_spectral_shape *b,
                                orb_zoom_pair *out) {
  *out = (orb_zoom_pair){.shape = {a, b}};
  for (int s = 0; s < 2; s++) {
    for (int level = 0; level < ORB_ZOOM_LEVELS; level++) {
      orb_status status = fit_create(ctx, out->shape[s], level, &out->fit[s][level]);
      if (status != ORB_OK) {
        return status;
      }
    }
  }
  return ORB_OK;
}

void orb_zoom_pair_free(orb_context *ctx, orb_zoom_pair *pair) {
  for (int s = 0; s < 2; s++) {
    for (int level = 0; level < ORB_ZOOM_LEVELS; level++) {
      orb_free(ctx, pair->fit[s][level]);
      pair->fit[s][level] = NULL;
    }
  }
}

void orb_zoom_start(const int to[ORB_ZOOM_START - 1], uint32_t signs, orb_zoom *out) {
  memset(out, 0, sizeof *out);
  out->size = ORB_ZOOM_START;
  out->matrix[0][0] = 1;
  for (int k = 0; k < ORB_ZOOM_START - 1; k++) {
    out->matrix[to[k]][k + 1] = signs >> k & 1 ? -1 : 1;
  }
}

/* The triple products of shape a as those of the functions of b that the map brings to it: they are 2 × 2 minors, so
 * the second compound matrix of the map takes them there. Those of functions beyond the map's are 0. */
static void bring_triples(const orb_zoom_pair *pair, const orb_zoom *map, float (*out)[S]) {
  enum { N = ORB_SPECTRAL_GRADIENTS };
  const double(*m)[K] = map->matrix;
  int known = map->size - 1 < N ? map->size - 1 : N, samples = orb_spectral_samples(map->detail), row = 0;
  for (int i = 0; i < N; i++) {
    for (int k = i + 1; k < N; k++, row++) {
      memset(out[row], 0, sizeof out[row]);
      for (int p = 0, column = 0; p < N; p++) {
        for (int q = p + 1; q < N; q++, column++) {
          const float *triple = pair->shape[0]->triple[column];
          float minor = (float)(m[i + 1][p + 1] * m[k + 1][q + 1] - m[i + 1][q + 1] * m[k + 1][p + 1]);
          for (int s = 0; s < samples && k < known && q < known && minor != 0; s++) {
            out[row][s] += minor * triple[s];
          }
        }
      }
    }
  }
}

/* The triple products of shape b; those of functions beyond the map's are 0. */
static void copy_triples(const orb_zoom_pair *pair, const orb_zoom *map, float (*out)[S]) {
  for (int i = 0, row = 0; i < ORB_SPECTRAL_GRADIENTS; i++) {
    for (int k = i + 1; k < ORB_SPECTRAL_GRADIENTS; k++, row++) {
      if (k < map->size - 1) {
        memcpy(out[row], pair->shape[1]->triple[row], sizeof out[row]);
      } else {
        memset(out[row], 0, sizeof out[row]);
      }
    }
  }
}

/* Scales the triple products at each sample to this length. */
static void scale_triples(float (*triple)[S], int samples, float length) {
  float sum[S] = {0};
  for (int i = 0; i < ORB_SPECTRAL_TRIPLES; i++) {
    for (int s = 0; s < samples; s++) {
      sum[s] += triple[i][s] * triple[i][s];
    }
  }
  for (int s = 0; s < samples; s++) {
    sum[s] = sum[s] > 0 ? length / sqrtf(sum[s]) : 0;
  }
  for (int i = 0; i < ORB_SPECTRAL_TRIPLES; i++) {
    for (int s = 0; s < samples; s++) {
      triple[i][s] *= sum[s];
    }
  }
}

static void fill_features(const orb_zoom_pair *pair, const orb_zoom *map, float weight, features *f) {
  int samples = orb_spectral_samples(map->detail);
  f->count = map->size + (weight > 0 ? ORB_SPECTRAL_TRIPLES : 0);
  for (int i = 0; i < map->size; i++) {
    memset(f->brought[i], 0, sizeof f->brought[i]);
    memcpy(f->there[i], pair->shape[1]->at[i], sizeof f->there[i]);
    for (int k = 0; k < map->size; k++) {
      float factor = (float)map->matrix[i][k];
      for (int s = 0; s < samples && factor != 0; s++) {
        f->brought[i][s] += factor * pair->shape[0]->at[k][s];
      }
    }
  }
  if (weight > 0) {
    bring_triples(pair, map, f->brought + map->size);
    copy_triples(pair, map, f->there + map->size);
    scale_triples(f->brought + map->size, samples, weight);
    scale_triples(f->there + map->size, samples, weight);
  }
}

/* Half the squared length of each sample. */
static void half_squares(float (*x)[S], int count, int samples, float *out) {
  memset(out, 0, S * sizeof *out);
  for (int d = 0; d < count; d++) {
    for (int s = 0; s < samples; s++) {
      out[s] += x[d][s] * x[d][s] / 2;
    }
  }
}

enum { ROWS = 4 }; /* samples of a that are compared with all of b in one pass */

/* Half the squared distances of ROWS samples of a from all of b, less half the squares of the former. */
static void compare(const features *f, const float *half, int row, int samples, float (*restrict out)[S]) {
  for (int r = 0; r < ROWS; r++) {
    memcpy(out[r], half, S * sizeof *half);
  }
  for (int d = 0; d < f->count; d++) {
    const float *restrict x = f->brought[d] + row, *restrict y = f->there[d];
    for (int s = 0; s < samples; s++) {
      out[0][s] -= x[0] * y[s];
      out[1][s] -= x[1] * y[s];
      out[2][s] -= x[2] * y[s];
      out[3][s] -= x[3] * y[s];
    }
  }
}

/* The first of the least values; in four lanes, so that the compiler may use vectors. */
static int least_of(const float *value, int count) {
  float least[4];
  int32_t at[4] = {0, 1, 2, 3};
  memcpy(least, value, sizeof least);
  for (int s = 4; s < count; s += 4) {
    for (int k = 0; k < 4; k++) {
      int is_less = value[s + k] < least[k];
      at[k] = is_less ? s + k : at[k];
      least[k] = is_less ? value[s + k] : least[k];
    }
  }
  int best = 0;
  for (int k = 1; k < 4; k++) {
    best = least[k] < least[best] || (least[k] == least[best] && at[k] < at[best]) ? k : best;
  }
  return at[best];
}

/* The nearest sample of the other shape for each sample of both. */
static void match_samples(features *f, int samples, orb_zoom *map) {
  float half[S], own[S], nearest[S], value[ROWS][S];
  half_squares(f->there, f->count, samples, half);
  half_squares(f->brought, f->count, samples, own);
  for (int s = 0; s < samples; s++) {
    nearest[s] = INFINITY;
    map->back[s] = 0;
  }
  for (int row = 0; row < samples; row += ROWS) {
    compare(f, half, row, samples, value);
    for (int r = 0; r < ROWS; r++) {
      const float *restrict x = value[r];
      int32_t *restrict back = map->back;
      float mine = own[row + r];
      map->forth[row + r] = least_of(x, samples);
      for (int s = 0; s < samples; s++) {
        int is_nearer = x[s] + mine < nearest[s];
        back[s] = is_nearer ? row + r : back[s];
        nearest[s] = is_nearer ? x[s] + mine : nearest[s];
      }
    }
  }
}

/* A sum in four parts, so that the compiler may use vectors. */
static double product(const double *x, const double *y, int count) {
  double sum[4] = {0};
  int i = 0;
  for (; i + 4 <= count; i += 4) {
    for (int k = 0; k < 4; k++) {
      sum[k] += x[i + k] * y[i + k];
    }
  }
  for (; i < count; i++) {
    sum[0] += x[i] * y[i];
  }
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/* X Xᵀ. Returns how far it is from the identity at most. *bound: at least the square of the greatest singular value. */
static double multiply_transpose(double (*x)[K], int size, double (*out)[K], double *bound) {
  double off = 0;
  *bound = 0;
  for (int i = 0; i < size; i++) {
    for (int k = 0; k <= i; k++) {
      out[i][k] = out[k][i] = product(x[i], x[k], size);
      off = fmax(off, fabs(out[i][k] - (i == k)));
    }
  }
  for (int i = 0; i < size; i++) {
    double row = 0;
    for (int k = 0; k < size; k++) {
      row += fabs(out[i][k]);
    }
    *bound = fmax(*bound, row);
  }
  return off;
}

/* The nearest orthogonal matrix of one whose singular values are near 1: X ← 1.5 X − 0.5 X Xᵀ X (Newton and Schulz),
 * which converges from singular values below √3; greater ones are scaled down. Those near 0 stay small. */
static void make_orthogonal(double (*x)[K], int size) {
  double square[K][K], next[K][K], bound;
  for (int step = 0; step < POLAR && multiply_transpose(x, size, square, &bound) > ORTHOGONAL; step++) {
    double scale = bound > CONVERGES ? sqrt(CONVERGES / bound) : 1;
    for (int i = 0; i < size; i++) {
      for (int k = 0; k < size; k++) {
        next[i][k] = 1.5 * scale * x[i][k];
      }
      for (int p = 0; p < size; p++) {
        double factor = 0.5 * scale * scale * scale * square[i][p];
        for (int k = 0; k < size; k++) {
          next[i][k] -= factor * x[p][k];
        }
      }
    }
    for (int i = 0; i < size; i++) {
      memcpy(x[i], next[i], (size_t)size * sizeof *next[i]);
    }
  }
}

/* Fits a matrix of more functions to both maps of samples. */
static void fit_matrix(const orb_zoom_pair *pair, int level, orb_zoom *map) {
  const orb_spectral_shape *a = pair->shape[0], *b = pair->shape[1];
  const double *fit_a = pair->fit[0][level], *fit_b = pair->fit[1][level];
  int size = level_size[level], samples = orb_spectral_samples(level_detail[level]);
  double there[S];
  memset(map->matrix, 0, sizeof map->matrix);
  map->size = size;
  for (int k = 0; k < size; k++) {
    for (int s = 0; s < samples; s++) {
      there[s] = a->at[k][map->back[s]] / 2;
    }
    for (int i = 0; i < size; i++) {
      map->matrix[i][k] += product(fit_b + i * samples, there, samples);
    }
    for (int s = 0; s < samples; s++) {
      there[s] = b->at[k][map->forth[s]] / 2;
    }
    for (int i = 0; i < size; i++) {
      map->matrix[k][i] += product(fit_a + i * samples, there, samples);
    }
  }
  make_orthogonal(map->matrix, size);
}

static void match(const orb_zoom_pair *pair, int level, orb_zoom *map) {
  features f;
  map->detail = level_detail[level];
  fill_features(pair, map, level_triple[level], &f);
  match_samples(&f, orb_spectral_samples(map->detail), map);
}

void orb_zoom_refine(const orb_zoom_pair *pair, int from, int to, orb_zoom *map) {
  for (int level = from; level < to; level++) {
    match(pair, level, map);
    fit_matrix(pair, level, map);
  }
  match(pair, to - 1, map);
}

int32_t orb_zoom_image(const orb_zoom_pair *pair, const orb_zoom *map, int32_t sample, int back) {
  return orb_zoom_vertex_image(pair, map, pair->shape[back ? 1 : 0]->sample[sample], back);
}

/* Adds the squared differences of one function at `count` vertices. */
ORB_CLONES static void add_squares(const double *function, double value, size_t count, double *restrict sum) {
  for (size_t i = 0; i < count; i++) {
    const double d = value - function[i];
    sum[i] += d * d;
  }
}

/* Compares an image with `count` vertices from `begin` on; the nearest one so far. */
static void look_at_block(const orb_spectral_shape *to, const double *point, int size, size_t begin, size_t count,
                          double *least, int32_t *nearest) {
  double sum[IMAGE_BLOCK] = {0};
  for (int k = 0; k < size; k++) {
    add_squares(to->function + (size_t)k * (size_t)to->mesh->vertex_count + begin, point[k], count, sum);
  }
  for (size_t i = 0; i < count; i++) {
    *nearest = sum[i] < *least ? (int32_t)(begin + i) : *nearest;
    *least = sum[i] < *least ? sum[i] : *least;
  }
}

int32_t orb_zoom_vertex_image(const orb_zoom_pair *pair, const orb_zoom *map, int32_t vertex, int back) {
  const orb_spectral_shape *from = pair->shape[back ? 1 : 0], *to = pair->shape[back ? 0 : 1];
  size_t n = (size_t)to->mesh->vertex_count, m = (size_t)from->mesh->vertex_count;
  double point[K] = {0}, least = INFINITY;
  int32_t nearest = 0;
  for (int i = 0; i < map->size; i++) {
    for (int k = 0; k < map->size; k++) {
      point[i] += (back ? map->matrix[k][i] : map->matrix[i][k]) * from->function[(size_t)k * m + (size_t)vertex];
    }
  }
  for (size_t begin = 0; begin < n; begin += IMAGE_BLOCK) {
    const size_t left = n - begin, count = left < IMAGE_BLOCK ? left : IMAGE_BLOCK;
    look_at_block(to, point, map->size, begin, count, &least, &nearest);
  }
  return nearest;
}

double orb_zoom_facing(const orb_zoom_pair *pair, const orb_zoom *map) {
  features f;
  const double *share = pair->shape[0]->share[map->detail];
  int samples = orb_spectral_samples(map->detail);
  double sum = 0;
  bring_triples(pair, map, f.brought);
  copy_triples(pair, map, f.there);
  scale_triples(f.brought, samples, 1);
  scale_triples(f.there, samples, 1);
  for (int i = 0; i < ORB_SPECTRAL_TRIPLES; i++) {
    for (int s = 0; s < samples; s++) {
      sum += share[s] * (double)(f.brought[i][s] * f.there[i][map->forth[s]]);
    }
  }
  return sum;
}
