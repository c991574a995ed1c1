/* ZoomOut (Melzi et al. 2019) in both directions, that minds orientation.
 *
 * Each step brings the functions of one shape to the other by the present matrix, takes the nearest sample there for
 * every sample, in both directions, and fits a matrix of more functions to both maps of samples; the nearest orthogonal
 * matrix is the next one. Functions alone do not tell left from right, nor front from back; but the gradients of two
 * functions turn one way on one side and the other way on the other, seen from outside. So the turns of the first
 * functions, brought over like these and scaled to unit length, are further coordinates. Once the matrix says which
 * side is left, they tell front from back at once, so that mirror images are not found at all.
 */
#include "align/spectral/zoom.h"

#include <math.h>
#include <string.h>

#include "base/memory.h"
#include "numeric/dense.h"

/* Chosen by trial on the pairs of posed people with even numbers. */
static const int level_size[ORB_ZOOM_LEVELS] = {7, 9, 12, 16, 20, 25, 31};
static const float level_turn[ORB_ZOOM_LEVELS] = {2, 2, 2, 2, 1, 1, 0}; /* weight of the turns */
static const int level_detail[ORB_ZOOM_LEVELS] = {0, 0, 1, 1, 2, 2, 2};

enum {
  S = ORB_SPECTRAL_SAMPLES,
  K = ORB_SPECTRAL_FUNCTIONS,
  COORDINATES = K + ORB_SPECTRAL_TURNS,
  POLAR = 16 /* steps to the nearest orthogonal matrix */
};

/* Samples of a as rows, samples of b as columns: one is nearest to another by the products of rows with columns. */
typedef struct features {
  int count; /* coordinates */
  float row[S][COORDINATES], column[COORDINATES][S];
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

/* The turns of a at a sample, brought to b: those of the functions Σ matrix · function. */
static void bring_turns(const orb_zoom *map, const double turn[ORB_SPECTRAL_TURNS], double out[ORB_SPECTRAL_TURNS]) {
  enum { N = ORB_SPECTRAL_TURNING };
  int known = map->size - 1 < N ? map->size - 1 : N;
  double full[N][N] = {{0}}, half[N][N] = {{0}};
  for (int i = 0, at = 0; i < N; i++) {
    for (int k = i + 1; k < N; k++, at++) {
      full[i][k] = turn[at];
      full[k][i] = -turn[at];
    }
  }
  for (int i = 0; i < known; i++) {
    for (int p = 0; p < known; p++) {
      for (int k = 0; k < known; k++) {
        half[i][k] += map->matrix[i + 1][p + 1] * full[p][k];
      }
    }
  }
  for (int i = 0, at = 0; i < N; i++) {
    for (int k = i + 1; k < N; k++, at++) {
      out[at] = 0;
      for (int p = 0; p < known && k < known; p++) {
        out[at] += half[i][p] * map->matrix[k + 1][p + 1];
      }
    }
  }
}

/* Turns that functions beyond the map's would need count as 0. */
static void drop_turns(const orb_zoom *map, const double turn[ORB_SPECTRAL_TURNS], double out[ORB_SPECTRAL_TURNS]) {
  for (int i = 0, at = 0; i < ORB_SPECTRAL_TURNING; i++) {
    for (int k = i + 1; k < ORB_SPECTRAL_TURNING; k++, at++) {
      out[at] = k < map->size - 1 ? turn[at] : 0;
    }
  }
}

static double length_of(const double turn[ORB_SPECTRAL_TURNS]) {
  double sum = 0;
  for (int i = 0; i < ORB_SPECTRAL_TURNS; i++) {
    sum += turn[i] * turn[i];
  }
  return sqrt(sum);
}

static void fill_features(const orb_zoom_pair *pair, const orb_zoom *map, float weight, features *f) {
  const orb_spectral_shape *a = pair->shape[0], *b = pair->shape[1];
  f->count = map->size + (weight > 0 ? ORB_SPECTRAL_TURNS : 0);
  for (int s = 0; s < orb_spectral_samples(map->detail); s++) {
    for (int i = 0; i < map->size; i++) {
      double sum = 0;
      for (int k = 0; k < map->size; k++) {
        sum += map->matrix[i][k] * a->at[k][s];
      }
      f->row[s][i] = (float)sum;
      f->column[i][s] = (float)b->at[i][s];
    }
    if (weight > 0) {
      double one[ORB_SPECTRAL_TURNS], other[ORB_SPECTRAL_TURNS];
      bring_turns(map, a->turn[s], one);
      drop_turns(map, b->turn[s], other);
      double x = length_of(one), y = length_of(other);
      for (int i = 0; i < ORB_SPECTRAL_TURNS; i++) {
        f->row[s][map->size + i] = x > 0 ? weight * (float)(one[i] / x) : 0;
        f->column[map->size + i][s] = y > 0 ? weight * (float)(other[i] / y) : 0;
      }
    }
  }
}

/* The nearest sample of the other shape for each sample of both. */
static void match_samples(const features *f, orb_zoom *map) {
  const int samples = orb_spectral_samples(map->detail);
  float half[S] = {0}, nearest[S], value[S];
  for (int d = 0; d < f->count; d++) {
    for (int s = 0; s < samples; s++) {
      half[s] += f->column[d][s] * f->column[d][s] / 2;
    }
  }
  for (int r = 0; r < samples; r++) {
    float own = 0;
    memcpy(value, half, sizeof value);
    for (int d = 0; d < f->count; d++) {
      float x = f->row[r][d];
      own += x * x / 2;
      for (int s = 0; s < samples; s++) {
        value[s] -= x * f->column[d][s];
      }
    }
    int best = 0;
    for (int s = 0; s < samples; s++) {
      best = value[s] < value[best] ? s : best;
      if (r == 0 || value[s] + own < nearest[s]) {
        nearest[s] = value[s] + own;
        map->back[s] = r;
      }
    }
    map->forth[r] = best;
  }
}

/* A sum in four parts, so that the compiler may use vectors; `count` is a multiple of four. */
static double product(const double *x, const double *y, int count) {
  double sum[4] = {0};
  for (int i = 0; i < count; i += 4) {
    for (int k = 0; k < 4; k++) {
      sum[k] += x[i + k] * y[i + k];
    }
  }
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/* The nearest orthogonal matrix of one whose singular values are near 1: X ← 1.5 X − 0.5 X Xᵀ X (Newton and Schulz),
 * after a scaling that makes the iteration converge. Singular values near 0 stay small. */
static void make_orthogonal(double (*x)[K], int size) {
  double most_row = 0, most_column = 0, square[K][K], next[K][K];
  for (int i = 0; i < size; i++) {
    double row = 0, column = 0;
    for (int k = 0; k < size; k++) {
      row += fabs(x[i][k]);
      column += fabs(x[k][i]);
    }
    most_row = fmax(most_row, row);
    most_column = fmax(most_column, column);
  }
  double bound = sqrt(most_row * most_column); /* at least the greatest singular value */
  if (!(bound > 0)) {
    return;
  }
  for (int i = 0; i < size; i++) {
    for (int k = 0; k < size; k++) {
      x[i][k] *= 1.5 / bound;
    }
  }
  for (int step = 0; step < POLAR; step++) {
    for (int i = 0; i < size; i++) {
      for (int k = 0; k <= i; k++) {
        double sum = 0;
        for (int p = 0; p < size; p++) {
          sum += x[i][p] * x[k][p];
        }
        square[i][k] = square[k][i] = sum;
      }
    }
    for (int i = 0; i < size; i++) {
      for (int k = 0; k < size; k++) {
        next[i][k] = 1.5 * x[i][k];
      }
      for (int p = 0; p < size; p++) {
        for (int k = 0; k < size; k++) {
          next[i][k] -= 0.5 * square[i][p] * x[p][k];
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
  fill_features(pair, map, level_turn[level], &f);
  match_samples(&f, map);
}

void orb_zoom_refine(const orb_zoom_pair *pair, int from, int to, orb_zoom *map) {
  for (int level = from; level < to; level++) {
    match(pair, level, map);
    fit_matrix(pair, level, map);
  }
  match(pair, to - 1, map);
}

int32_t orb_zoom_image(const orb_zoom_pair *pair, const orb_zoom *map, int32_t sample, int back) {
  const orb_spectral_shape *from = pair->shape[back ? 1 : 0], *to = pair->shape[back ? 0 : 1];
  size_t n = (size_t)to->mesh->vertex_count;
  double point[K] = {0}, best = INFINITY;
  int32_t nearest = 0;
  for (int i = 0; i < map->size; i++) {
    for (int k = 0; k < map->size; k++) {
      point[i] += (back ? map->matrix[k][i] : map->matrix[i][k]) * from->at[k][sample];
    }
  }
  for (size_t v = 0; v < n; v++) {
    double sum = 0;
    for (int k = 0; k < map->size && sum < best; k++) {
      double d = point[k] - to->function[(size_t)k * n + v];
      sum += d * d;
    }
    if (sum < best) {
      best = sum;
      nearest = (int32_t)v;
    }
  }
  return nearest;
}

double orb_zoom_facing(const orb_zoom_pair *pair, const orb_zoom *map) {
  const double *share = pair->shape[0]->share[map->detail];
  double sum = 0;
  for (int s = 0; s < orb_spectral_samples(map->detail); s++) {
    double brought[ORB_SPECTRAL_TURNS], same = 0;
    const double *there = pair->shape[1]->turn[map->forth[s]];
    bring_turns(map, pair->shape[0]->turn[s], brought);
    for (int i = 0; i < ORB_SPECTRAL_TURNS; i++) {
      same += brought[i] * there[i];
    }
    double length = length_of(brought) * length_of(there);
    sum += length > 0 ? share[s] * same / length : 0;
  }
  return sum;
}
