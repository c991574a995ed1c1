#include "numeric/dense.h"

#include <math.h>
#include <string.h>

#include "numeric/vec3.h"

enum {
  BLOCK = 32, /* columns that are eliminated before the rest of the matrix is updated */
  SWEEPS = 40 /* of the Jacobi iteration at most; it converges quadratically */
};

#if defined(__x86_64__) && defined(__gnu_linux__) && !defined(__clang__)
#define ORB_WIDER __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define ORB_WIDER
#endif

/* y −= Σ_k factor[k] · row k of x; elementwise and in order of k, so that the vector width changes no bit. */
ORB_WIDER static void subtract_rows(double *restrict y, const double *factor, int32_t count, const double *restrict x,
                                    int64_t stride, int32_t length) {
  for (int32_t k = 0; k < count; k++) {
    double f = factor[k];
    const double *row = x + k * stride;
    for (int32_t j = 0; j < length; j++) {
      y[j] -= f * row[j];
    }
  }
}

static void swap_rows(double *a, double *b, int64_t length) {
  for (int64_t j = 0; j < length; j++) {
    double t = a[j];
    a[j] = b[j];
    b[j] = t;
  }
}

/* Eliminates the columns first … last − 1 below the diagonal, within the panel; the factors replace the zeros. */
static int factor_panel(int64_t n, double *matrix, int32_t columns, double *right, int64_t first, int64_t last) {
  for (int64_t k = first; k < last; k++) {
    int64_t best = k;
    for (int64_t i = k + 1; i < n; i++) {
      best = fabs(matrix[i * n + k]) > fabs(matrix[best * n + k]) ? i : best;
    }
    double pivot = matrix[best * n + k];
    if (pivot == 0 || !isfinite(pivot)) {
      return -1;
    }
    if (best != k) {
      swap_rows(matrix + best * n, matrix + k * n, n);
      swap_rows(right + best * columns, right + k * columns, columns);
    }
    for (int64_t i = k + 1; i < n; i++) {
      double f = matrix[i * n + k] /= pivot;
      if (f != 0) {
        subtract_rows(matrix + i * n + k + 1, &f, 1, matrix + k * n + k + 1, n, (int32_t)(last - k - 1));
      }
    }
  }
  return 0;
}

int orb_dense_solve(int32_t size, double *matrix, int32_t columns, double *right) {
  int64_t n = size;
  for (int64_t first = 0; first < n; first += BLOCK) {
    int64_t last = first + BLOCK < n ? first + BLOCK : n;
    if (factor_panel(n, matrix, columns, right, first, last) != 0) {
      return -1;
    }
    for (int64_t i = first + 1; i < n; i++) { /* the rows of the block come first: those below need them finished */
      int32_t count = (int32_t)(i < last ? i - first : last - first);
      const double *factor = matrix + i * n + first;
      subtract_rows(matrix + i * n + last, factor, count, matrix + first * n + last, n, (int32_t)(n - last));
      subtract_rows(right + i * columns, factor, count, right + first * columns, columns, columns);
    }
  }
  for (int64_t i = n - 1; i >= 0; i--) {
    double *x = right + i * columns;
    subtract_rows(x, matrix + i * n + i + 1, (int32_t)(n - i - 1), right + (i + 1) * columns, columns, columns);
    for (int32_t j = 0; j < columns; j++) {
      x[j] /= matrix[i * n + i];
    }
  }
  return 0;
}

/* Rotates the rows p and q of both w and v so that those of w become orthogonal; returns 0 if they were. */
static int rotate(double w[3][3], double v[3][3], int p, int q) {
  double a = orb_dot(w[p], w[p]), b = orb_dot(w[q], w[q]), c = orb_dot(w[p], w[q]);
  if (!(fabs(c) > 1e-16 * sqrt(a) * sqrt(b))) {
    return 0;
  }
  double zeta = (b - a) / (2 * c), t = copysign(1, zeta) / (fabs(zeta) + sqrt(1 + zeta * zeta));
  double cosine = 1 / sqrt(1 + t * t), sine = cosine * t;
  for (int k = 0; k < 3; k++) {
    double x = w[p][k], y = w[q][k];
    w[p][k] = cosine * x - sine * y;
    w[q][k] = sine * x + cosine * y;
    x = v[p][k];
    y = v[q][k];
    v[p][k] = cosine * x - sine * y;
    v[q][k] = sine * x + cosine * y;
  }
  return 1;
}

static void sort_descending(double w[3][3], double v[3][3], double s[3]) {
  for (int i = 0; i < 3; i++) {
    s[i] = orb_length(w[i]);
  }
  for (int i = 0; i < 2; i++) {
    for (int j = 0; j + 1 < 3 - i; j++) {
      if (s[j] < s[j + 1]) {
        swap_rows(&s[j], &s[j + 1], 1);
        swap_rows(w[j], w[j + 1], 3);
        swap_rows(v[j], v[j + 1], 3);
      }
    }
  }
}

/* A unit vector orthogonal to the unit vector a. */
static void orthogonal_to(const double a[3], double out[3]) {
  int least = fabs(a[0]) < fabs(a[1]) ? 0 : 1;
  least = fabs(a[2]) < fabs(a[least]) ? 2 : least;
  double axis[3] = {least == 0, least == 1, least == 2};
  orb_cross(a, axis, out);
  (void)orb_normalize(out);
}

void orb_svd3(const double a[9], double u[9], double s[3], double v[9]) {
  double w[3][3], right[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, left[3][3], greatest = 0;
  for (int i = 0; i < 9; i++) {
    greatest = fmax(greatest, fabs(a[i]));
  }
  int power = 0;
  (void)frexp(greatest, &power); /* scaling by a power of two is exact, and keeps squares from over- and underflowing */
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++) {
      w[j][i] = ldexp(a[3 * i + j], -power);
    }
  }
  for (int sweep = 0; sweep < SWEEPS; sweep++) {
    if (!(rotate(w, right, 0, 1) | rotate(w, right, 0, 2) | rotate(w, right, 1, 2))) {
      break;
    }
  }
  sort_descending(w, right, s);
  const double axis[3] = {1, 0, 0};
  for (int k = 0; k < 3; k++) { /* a direction that only rounding determines is replaced by an orthogonal one */
    memcpy(left[k], w[k], sizeof left[k]);
    if (k == 0 && !(orb_normalize(left[0]) > 0)) {
      memcpy(left[0], axis, sizeof axis);
    } else if (k == 1 && (!(s[1] > 1e-15 * s[0]) || !(orb_normalize(left[1]) > 0))) {
      orthogonal_to(left[0], left[1]);
    } else if (k == 2) {
      orb_cross(left[0], left[1], left[2]);
      (void)orb_normalize(left[2]);
      if (orb_dot(left[2], w[2]) < 0) {
        for (int i = 0; i < 3; i++) {
          left[2][i] = -left[2][i];
        }
      }
    }
  }
  for (int i = 0; i < 3; i++) {
    s[i] = ldexp(s[i], power);
    for (int k = 0; k < 3; k++) {
      u[3 * i + k] = left[k][i];
      v[3 * i + k] = right[k][i];
    }
  }
}
