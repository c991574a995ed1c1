#include "align/rbf/warp.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/dense.h"
#include "numeric/vec3.h"

enum { GRAIN = 512 };                   /* points of one task */
static const double LEAST_PIVOT = 1e-6; /* of the Gram matrix: centres within 0.001 of a plane do not span space */

double orb_warp_phi(double r) {
  if (r >= 1) {
    return 0;
  }
  double r2 = r * r, r3 = r2 * r;
  return 1 - 30 * r2 - 10 * r3 + 45 * r2 * r2 - 6 * r3 * r2 - (r > 0 ? 60 * r3 * log(r) : 0);
}

void orb_warp_free(orb_context *ctx, orb_warp *warp) {
  orb_free(ctx, warp->centres);
  orb_free(ctx, warp->coefficients);
  orb_free(ctx, warp->radii);
  memset(warp, 0, sizeof *warp);
}

/* Do the centres span space affinely? Eliminates the Gram matrix of (1, x, y, z); a pivot near zero says no. */
static int spans(const double *centres, int32_t count) {
  double g[4][4] = {{0}};
  for (int32_t k = 0; k < count; k++) {
    double row[4] = {1, centres[3 * k], centres[3 * k + 1], centres[3 * k + 2]};
    for (int i = 0; i < 4; i++) {
      for (int j = 0; j < 4; j++) {
        g[i][j] += row[i] * row[j] / count;
      }
    }
  }
  for (int i = 0; i < 4; i++) {
    if (g[i][i] < LEAST_PIVOT) {
      return 0;
    }
    for (int j = i + 1; j < 4; j++) {
      double f = g[j][i] / g[i][i];
      for (int k = i; k < 4; k++) {
        g[j][k] -= f * g[i][k];
      }
    }
  }
  return 1;
}

/* The matrix [Φ P; Pᵀ 0] and its right-hand sides, row by row. */
static void assemble(const orb_warp *w, const double *moves, int32_t rows, double *matrix, double *right) {
  size_t n = (size_t)rows, count = (size_t)w->count;
  memset(matrix, 0, n * n * sizeof *matrix);
  memset(right, 0, 3 * n * sizeof *right);
  for (size_t i = 0; i < count; i++) {
    for (size_t k = 0; k < count; k++) {
      double r = sqrt(orb_distance2(w->centres + 3 * i, w->centres + 3 * k));
      matrix[i * n + k] = orb_warp_phi(r / w->radii[k]);
    }
    for (size_t j = 0; n > count && j < 4; j++) {
      double value = j == 0 ? 1 : w->centres[3 * i + j - 1];
      matrix[i * n + count + j] = matrix[(count + j) * n + i] = value;
    }
    for (size_t c = 0; c < 3; c++) {
      right[3 * i + c] = moves[3 * i + c];
    }
  }
}

orb_status orb_warp_create(orb_context *ctx, const double *centres, const double *moves, const double *radii,
                           int32_t count, orb_warp *out) {
  orb_status status = ORB_OK;
  int32_t rows = count + (spans(centres, count) ? 4 : 0);
  size_t n = (size_t)rows;
  *out = (orb_warp){.count = count};
  out->centres = ORB_NEW(ctx, double, 3 * (size_t)count);
  out->coefficients = ORB_NEW(ctx, double, 3 * (size_t)count);
  out->radii = ORB_NEW(ctx, double, count);
  double *matrix = ORB_NEW(ctx, double, n *n), *right = ORB_NEW(ctx, double, 3 * n);
  if (!out->centres || !out->coefficients || !out->radii || !matrix || !right) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  memcpy(out->centres, centres, 3 * (size_t)count * sizeof *centres);
  memcpy(out->radii, radii, (size_t)count * sizeof *radii);
  assemble(out, moves, rows, matrix, right);
  if (orb_dense_solve(rows, matrix, 3, right) != 0) {
    status = orb_fail(ctx, ORB_E_BAD_LANDMARKS, "Two landmarks are too close for a warp to tell them apart.");
    goto end;
  }
  for (size_t c = 0; c < 3; c++) {
    for (size_t k = 0; k < (size_t)count; k++) {
      out->coefficients[3 * k + c] = right[3 * k + c];
    }
    for (size_t j = 0; rows > count && j < 4; j++) {
      out->linear[j][c] = right[3 * ((size_t)count + j) + c];
    }
  }
end:
  orb_free(ctx, matrix);
  orb_free(ctx, right);
  if (status != ORB_OK) {
    orb_warp_free(ctx, out);
  }
  return status;
}

typedef struct apply_loop {
  const orb_warp *warp;
  const double *in;
  double *out;
} apply_loop;

static void apply(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  const apply_loop *loop = arg;
  const orb_warp *w = loop->warp;
  for (int64_t v = begin; v < end; v++) {
    const double *p = loop->in + 3 * v;
    double x[3];
    for (int c = 0; c < 3; c++) {
      x[c] = p[c] + w->linear[0][c] + p[0] * w->linear[1][c] + p[1] * w->linear[2][c] + p[2] * w->linear[3][c];
    }
    for (int32_t k = 0; k < w->count; k++) {
      double r2 = orb_distance2(p, w->centres + 3 * (size_t)k), radius = w->radii[k];
      if (r2 < radius * radius) {
        double f = orb_warp_phi(sqrt(r2) / radius);
        for (int c = 0; c < 3; c++) {
          x[c] += f * w->coefficients[3 * (size_t)k + (size_t)c];
        }
      }
    }
    orb_normalize(x);
    memcpy(loop->out + 3 * v, x, sizeof x);
  }
}

void orb_warp_apply(orb_context *ctx, const orb_warp *warp, const double *points, int32_t count, double *out) {
  apply_loop loop = {warp, points, out};
  orb_parallel_for(ctx, count, GRAIN, apply, &loop);
}
