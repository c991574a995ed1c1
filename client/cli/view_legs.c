#include "view_legs.h"

#include <math.h>
#include <stdlib.h>

enum {
  FINE = 64,      /* cells along the longest axis */
  LEAST_PIECE = 2 /* cells */
};

/* A body on two legs has slices of two pieces over at least this much of its height, and this many times as much as at
 * its other end. Of 24 people in poses, a run and a crouch among them, and two in T-pose, the legs have 0.18 to 0.48,
 * and arms that are up half of them. */
static const double LEGS_LEAST = 0.15, LEGS_TIMES = 1.6;
/* Legs carry a body, so they are thick: of the same people, an armadillo and a penguin, the slices of two legs have at
 * least 0.45 of the mean area of a slice. The horns of a goat have 0.27, horns and ears of a cow 0.12, and arms that
 * are up 0.37 at most. */
static const double LEGS_THICK = 0.35;
/* Two prongs that are no legs point up if they have at least this much of the extent, and this many times as much as
 * those at any other end. */
static const double HORNS_LEAST = 0.1, HORNS_TIMES = 1.6;
/* A body that stands is at least this tall, relative to its longest axis: arms that are stretched out are as long. */
static const double TALL = 0.85;
/* Where the extent along y is not below this, y may be its height, and other axes need this many times as much. */
static const double THIN = 0.6, LEGS_OF_Y = 1.3;

const view_way view_ways[VIEW_WAYS] = {{'z', 2, 0}, {'Z', 2, 1}, {'x', 0, 0}, {'X', 0, 1}};

/* A fine grid of the shape, for slices. Its cells are cubes, since the gap between two legs is narrow. */
typedef struct slices {
  int count[3]; /* cells along each axis */
  double size;
  float low[3];
  unsigned char *cell; /* x, y, z */
} slices;

static void box_of(const view_mesh *mesh, float low[3], float high[3]) {
  for (int k = 0; k < 3; k++) {
    low[k] = INFINITY;
    high[k] = -INFINITY;
  }
  for (uint32_t i = 0; i < mesh->index_count; i++) {
    for (int k = 0; k < 3; k++) {
      float x = mesh->positions[3 * (size_t)mesh->indices[i] + (size_t)k];
      low[k] = fminf(low[k], x);
      high[k] = fmaxf(high[k], x);
    }
  }
}

static size_t cell_of(const slices *s, const int at[3]) {
  return ((size_t)at[0] * (size_t)s->count[1] + (size_t)at[1]) * (size_t)s->count[2] + (size_t)at[2];
}

/* Marks the cells that a triangle passes through, by samples no farther apart than half a cell. */
static void mark(const view_mesh *mesh, const uint32_t *corner, slices *s) {
  double p[3][3], longest = 0;
  for (int c = 0; c < 3; c++) {
    for (int k = 0; k < 3; k++) {
      p[c][k] = (double)(mesh->positions[3 * (size_t)corner[c] + (size_t)k] - s->low[k]) / s->size;
    }
  }
  for (int c = 0; c < 3; c++) {
    const double *q = p[(c + 1) % 3];
    longest = fmax(longest, hypot(hypot(q[0] - p[c][0], q[1] - p[c][1]), q[2] - p[c][2]));
  }
  const int steps = (int)fmin(1 + 2 * longest, 4 * FINE);
  for (int a = 0; a <= steps; a++) {
    for (int b = 0; a + b <= steps; b++) {
      int at[3];
      for (int k = 0; k < 3; k++) {
        int cell = (int)((a * p[0][k] + b * p[1][k] + (steps - a - b) * p[2][k]) / steps);
        at[k] = cell < 0 ? 0 : cell >= s->count[k] ? s->count[k] - 1 : cell;
      }
      s->cell[cell_of(s, at)] = 1;
    }
  }
}

/* 0: out of memory, or the shape has no extent. */
static int slices_open(const view_mesh *mesh, slices *s) {
  float high[3], most = 0;
  box_of(mesh, s->low, high);
  for (int k = 0; k < 3; k++) {
    most = fmaxf(most, high[k] - s->low[k]);
  }
  s->size = (double)most / FINE;
  for (int k = 0; k < 3 && s->size > 0; k++) {
    s->count[k] = (int)fmin(1 + (double)(high[k] - s->low[k]) / s->size, FINE);
  }
  s->cell = s->size > 0 ? calloc((size_t)s->count[0] * (size_t)s->count[1] * (size_t)s->count[2], 1) : NULL;
  for (uint32_t i = 0; s->cell && i + 2 < mesh->index_count; i += 3) {
    mark(mesh, mesh->indices + i, s);
  }
  return s->cell != NULL;
}

/* The pieces of a slice across an axis that have LEAST_PIECE cells or more. */
static int pieces_of(const slices *s, int axis, int slice) {
  static const int side[8][2] = {{0, 1}, {0, -1}, {1, 0}, {-1, 0}, {1, 1}, {1, -1}, {-1, 1}, {-1, -1}};
  const int u = (axis + 1) % 3, v = (axis + 2) % 3, n = s->count[u] * s->count[v];
  unsigned char open[FINE * FINE];
  int waiting[FINE * FINE], pieces = 0;
  for (int i = 0; i < n; i++) {
    int at[3];
    at[axis] = slice;
    at[u] = i / s->count[v];
    at[v] = i % s->count[v];
    open[i] = s->cell[cell_of(s, at)];
  }
  for (int i = 0; i < n; i++) {
    int height = 0, cells = 0;
    if (!open[i]) {
      continue;
    }
    open[i] = 0;
    for (waiting[height++] = i; height; cells++) {
      const int at = waiting[--height];
      for (int d = 0; d < 8; d++) {
        const int a = at / s->count[v] + side[d][0], b = at % s->count[v] + side[d][1];
        if (a >= 0 && a < s->count[u] && b >= 0 && b < s->count[v] && open[a * s->count[v] + b]) {
          open[a * s->count[v] + b] = 0;
          waiting[height++] = a * s->count[v] + b;
        }
      }
    }
    pieces += cells >= LEAST_PIECE;
  }
  return pieces;
}

/* The cells of a slice that the surface passes through or encloses. */
static int area_of(const slices *s, int axis, int slice) {
  static const int side[4][2] = {{0, 1}, {0, -1}, {1, 0}, {-1, 0}};
  const int u = (axis + 1) % 3, v = (axis + 2) % 3, wide = s->count[u] + 2, deep = s->count[v] + 2; /* with a rim */
  unsigned char seen[(FINE + 2) * (FINE + 2)] = {1};
  int waiting[(FINE + 2) * (FINE + 2)] = {0}, height = 1, outside = 0;
  for (; height; outside++) {
    const int from = waiting[--height];
    for (int d = 0; d < 4; d++) {
      const int a = from / deep + side[d][0], b = from % deep + side[d][1];
      int at[3];
      at[axis] = slice;
      at[u] = a - 1;
      at[v] = b - 1;
      if (a < 0 || a == wide || b < 0 || b == deep || seen[a * deep + b] ||
          (a > 0 && a < wide - 1 && b > 0 && b < deep - 1 && s->cell[cell_of(s, at)])) {
        continue;
      }
      seen[a * deep + b] = 1;
      waiting[height++] = a * deep + b;
    }
  }
  return wide * deep - outside;
}

typedef struct prongs {
  double share; /* of the extent along the axis */
  double thick; /* their area relative to that of a slice */
} prongs;

/* The slices of two pieces in the half at this end of an axis. */
static prongs prongs_of(const slices *s, int axis, int high_end) {
  const int count = s->count[axis];
  int two = 0;
  double area = 0, all = 0;
  for (int i = 0; i < count; i++) {
    const int slice = high_end ? count - 1 - i : i, here = area_of(s, axis, slice);
    all += here;
    if (i < count / 2 && pieces_of(s, axis, slice) == 2) {
      two++;
      area += here;
    }
  }
  return (prongs){.share = (double)two / count, .thick = two ? area / two / (all / count) : 0};
}

/* How much of the shape's extent along an axis is two legs. */
static double legs(const slices *s, int axis, int high_end) {
  const prongs both = prongs_of(s, axis, high_end);
  return both.thick >= LEGS_THICK ? both.share : 0;
}

int view_is_thin(const view_mesh *mesh, char up) {
  slices s = {0};
  int thin = 0;
  for (size_t i = 0; i < VIEW_WAYS && slices_open(mesh, &s); i++) {
    if (view_ways[i].up == up && s.count[view_ways[i].axis] >= TALL * FINE) {
      const prongs both = prongs_of(&s, view_ways[i].axis, view_ways[i].high_end);
      thin = both.share > 0 && both.thick < LEGS_THICK;
    }
    free(s.cell);
  }
  return thin;
}

char view_find_horns(const view_mesh *mesh) {
  static const char ways[3][2] = {{'X', 'x'}, {'Y', 'y'}, {'Z', 'z'}};
  slices s = {0};
  double most = 0, second = 0;
  char up = 0;
  if (!slices_open(mesh, &s)) {
    return 0;
  }
  for (int i = 0; i < 6; i++) {
    const prongs both = prongs_of(&s, i / 2, i % 2);
    const double share = s.count[i / 2] >= TALL * FINE && both.thick < LEGS_THICK ? both.share : 0;
    second = fmax(second, fmin(share, most));
    if (share > most) {
      most = share;
      up = ways[i / 2][i % 2];
    }
  }
  free(s.cell);
  return most >= HORNS_LEAST && most >= HORNS_TIMES * second && up != 'Y' ? up : 0;
}

char view_find_biped(const view_mesh *mesh, int sideways) {
  slices s = {0};
  char up = 0;
  double most = LEGS_LEAST;
  if (!slices_open(mesh, &s)) {
    return up;
  }
  if (!sideways && s.count[1] >= THIN * FINE) {
    const double below = legs(&s, 1, 0), above = legs(&s, 1, 1);
    up = below > LEGS_LEAST && below > above ? 'y' : 0;
    most = fmax(most, LEGS_OF_Y * fmax(below, above));
  }
  for (size_t i = 0; i < VIEW_WAYS; i++) {
    const int axis = view_ways[i].axis, high_end = view_ways[i].high_end;
    const double here = s.count[axis] >= TALL * FINE ? legs(&s, axis, high_end) : 0;
    if (here > most && here > LEGS_TIMES * legs(&s, axis, !high_end)) {
      most = here;
      up = view_ways[i].up;
    }
  }
  free(s.cell);
  return up;
}
