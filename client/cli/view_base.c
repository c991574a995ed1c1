#include "view_base.h"

#include <math.h>

/* A base lies within this share of the extent at one end, */
static const double NEAR = 0.03;
/* and its triangles face that end: the least cosine. */
static const double FACING = 0.9;
/* Least area of a base, relative to the bounding box's side there, and relative to those at other ends. Of the test
 * meshes the bases of a bust, a penguin and a teapot have 0.25 and more; feet of people and animals have 0.09 at most,
 * and sides of boats and boxes have partners. */
static const double LEAST = 0.15, TIMES = 3;
/* Least height relative to the longest extent: a relief is flat behind, and does not stand on its back. */
static const double TALL = 0.75;

typedef struct box {
  double low[3], high[3];
} box;

static box box_of(const view_mesh *mesh) {
  box b = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
  for (uint32_t i = 0; i < mesh->index_count; i++) {
    for (int k = 0; k < 3; k++) {
      const double x = (double)mesh->positions[3 * (size_t)mesh->indices[i] + (size_t)k];
      b.low[k] = fmin(b.low[k], x);
      b.high[k] = fmax(b.high[k], x);
    }
  }
  return b;
}

/* Adds the triangle's area to that of the end at which it lies flat, low ends first. */
static void add(const box *b, const double p[3][3], double flat[3][2]) {
  double n[3], area = 0;
  for (int k = 0; k < 3; k++) {
    const int u = (k + 1) % 3, v = (k + 2) % 3;
    n[k] = (p[1][u] - p[0][u]) * (p[2][v] - p[0][v]) - (p[1][v] - p[0][v]) * (p[2][u] - p[0][u]);
    area += n[k] * n[k];
  }
  area = sqrt(area);
  for (int k = 0; k < 3; k++) {
    for (int end = 0; end < 2; end++) {
      const double at = end ? b->high[k] : b->low[k], reach = NEAR * (b->high[k] - b->low[k]);
      const double off = fmax(fabs(p[0][k] - at), fmax(fabs(p[1][k] - at), fabs(p[2][k] - at)));
      flat[k][end] += off < reach && n[k] * (end ? 1 : -1) > FACING * area ? area / 2 : 0;
    }
  }
}

static char up_of(const box *b, double flat[3][2]) {
  static const char up[3][2] = {{'x', 'X'}, {'y', 'Y'}, {'z', 'Z'}};
  double most = 0, second = 0, longest = 0;
  int axis = 0, end = 0;
  for (int i = 0; i < 6; i++) {
    const int k = i / 2, u = (k + 1) % 3, v = (k + 2) % 3;
    const double side = (b->high[u] - b->low[u]) * (b->high[v] - b->low[v]);
    const double share = side > 0 ? flat[k][i % 2] / side : 0;
    longest = fmax(longest, b->high[k] - b->low[k]);
    second = fmax(second, fmin(share, most));
    if (share > most) {
      most = share;
      axis = k;
      end = i % 2;
    }
  }
  return most >= LEAST && most >= TIMES * second && b->high[axis] - b->low[axis] >= TALL * longest ? up[axis][end] : 0;
}

char view_find_base(const view_mesh *mesh) {
  const box b = box_of(mesh);
  double flat[3][2] = {{0}};
  for (uint32_t i = 0; i + 2 < mesh->index_count; i += 3) {
    double p[3][3];
    for (int c = 0; c < 3; c++) {
      for (int k = 0; k < 3; k++) {
        p[c][k] = (double)mesh->positions[3 * (size_t)mesh->indices[i + (uint32_t)c] + (size_t)k];
      }
    }
    add(&b, p, flat);
  }
  return up_of(&b, flat);
}
