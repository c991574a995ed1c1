#include "transfer/groups.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"

/* About this many groups, each of at least LEAST_SIZE vertices: more groups make the correction better, but its
 * factorisation, which is cubic in their number, slower. */
enum { GROUPS = 384, LEAST_SIZE = 16 };
enum { LEAST_SHARE = 4 }; /* a group of less than this fraction of the usual size joins a neighbour */
/* A constant solves the homogeneous system. A diagonal larger by a relative 1e-8 makes the matrix regular and does not
 * matter to a preconditioner. The absolute part serves a group without neighbours. */
static const double REGULAR = 1e-8, ALONE = 1e-12;
/* Square of a pivot: keeps its inverse finite where rounding leaves nothing. */
static const double LEAST_PIVOT = 1e-300;

void orb_groups_free(orb_context *ctx, orb_groups *groups) {
  orb_free(ctx, groups->group);
  orb_free(ctx, groups->factor);
  orb_free(ctx, groups->sums);
  memset(groups, 0, sizeof *groups);
}

/* Grows groups of `size` vertices, breadth first; smaller pieces join a neighbouring group. */
static void make_groups(orb_groups *groups, const int32_t *first, const int32_t *neighbor, int32_t size,
                        int32_t *queue) {
  int32_t *group = groups->group, count = 0;
  for (int32_t v = 0; v < groups->vertex_count; v++) {
    group[v] = -1;
  }
  for (int32_t seed = 0; seed < groups->vertex_count; seed++) {
    if (group[seed] >= 0) {
      continue;
    }
    int32_t head = 0, tail = 0, beside = -1;
    queue[tail++] = seed;
    group[seed] = count;
    while (head < tail) {
      int32_t v = queue[head++];
      for (int32_t i = first[v]; i < first[v + 1]; i++) {
        int32_t u = neighbor[i];
        if (group[u] >= 0) {
          beside = group[u] != count ? group[u] : beside;
        } else if (tail < size) {
          group[u] = count;
          queue[tail++] = u;
        }
      }
    }
    if (tail < size / LEAST_SHARE && beside >= 0) {
      for (int32_t i = 0; i < tail; i++) {
        group[queue[i]] = beside;
      }
    } else {
      count++;
    }
  }
  groups->group_count = count;
}

static double dot(const double *a, const double *b, int32_t n) {
  double sum[4] = {0};
  int32_t i = 0;
  for (; i + 4 <= n; i += 4) {
    for (int k = 0; k < 4; k++) {
      sum[k] += a[i + k] * b[i + k];
    }
  }
  for (; i < n; i++) {
    sum[0] += a[i] * b[i];
  }
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

static orb_status factorise(orb_context *ctx, double *m, int32_t n) {
  for (int32_t i = 0; i < n; i++) {
    for (int32_t j = 0; j <= i; j++) {
      double rest = m[(int64_t)i * n + j] - dot(m + (int64_t)i * n, m + (int64_t)j * n, j);
      if (i == j) {
        m[(int64_t)i * n + i] = sqrt(rest > LEAST_PIVOT ? rest : LEAST_PIVOT);
      } else {
        m[(int64_t)i * n + j] = rest / m[(int64_t)j * n + j];
      }
    }
    ORB_TRY(orb_context_check(ctx));
  }
  return ORB_OK;
}

orb_status orb_groups_create(orb_context *ctx, const int32_t *first, const int32_t *neighbor, const double *weight,
                             int32_t vertex_count, orb_groups *out) {
  memset(out, 0, sizeof *out);
  out->vertex_count = vertex_count;
  out->group = ORB_NEW(ctx, int32_t, vertex_count);
  int32_t *queue = ORB_NEW(ctx, int32_t, vertex_count), size = vertex_count / GROUPS;
  orb_status status = out->group && queue ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    make_groups(out, first, neighbor, size < LEAST_SIZE ? LEAST_SIZE : size, queue);
    int64_t n = out->group_count;
    out->factor = ORB_NEW0(ctx, double, (n * n));
    out->sums = ORB_NEW0(ctx, double, 3 * n);
    if (!out->factor || !out->sums) {
      status = ORB_E_NO_MEMORY;
    }
  }
  if (status == ORB_OK) {
    int64_t n = out->group_count;
    for (int32_t v = 0; v < vertex_count; v++) {
      int64_t g = out->group[v];
      for (int32_t i = first[v]; i < first[v + 1]; i++) {
        int64_t h = out->group[neighbor[i]];
        if (g != h) {
          out->factor[g * n + g] += weight[i];
          out->factor[g * n + h] -= weight[i];
        }
      }
    }
    for (int64_t g = 0; g < n; g++) {
      out->factor[g * n + g] *= 1 + REGULAR;
      out->factor[g * n + g] += ALONE;
    }
    status = factorise(ctx, out->factor, out->group_count);
  }
  orb_free(ctx, queue);
  if (status != ORB_OK) {
    orb_groups_free(ctx, out);
  }
  return status;
}

void orb_groups_solve(orb_groups *groups, const double *r) {
  int32_t n = groups->group_count;
  double *x = groups->sums;
  memset(x, 0, 3 * (size_t)n * sizeof *x);
  for (int64_t v = 0; v < groups->vertex_count; v++) {
    double *sum = x + 3 * (int64_t)groups->group[v];
    sum[0] += r[3 * v];
    sum[1] += r[3 * v + 1];
    sum[2] += r[3 * v + 2];
  }
  for (int64_t i = 0; i < n; i++) { /* L y = sums, then Lᵀ x = y: both by rows of L */
    const double *row = groups->factor + i * n;
    for (int64_t j = 0; j < i; j++) {
      for (int c = 0; c < 3; c++) {
        x[3 * i + c] -= row[j] * x[3 * j + c];
      }
    }
    for (int c = 0; c < 3; c++) {
      x[3 * i + c] /= row[i];
    }
  }
  for (int64_t i = n - 1; i >= 0; i--) {
    const double *row = groups->factor + i * n;
    for (int c = 0; c < 3; c++) {
      x[3 * i + c] /= row[i];
    }
    for (int64_t j = 0; j < i; j++) {
      for (int c = 0; c < 3; c++) {
        x[3 * j + c] -= row[j] * x[3 * i + c];
      }
    }
  }
}
