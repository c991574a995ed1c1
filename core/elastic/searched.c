#include "elastic/searched.h"

#include <math.h>
#include <string.h>

#include "base/memory.h"
#include "numeric/clones.h"

/* BLOCK: vertices of a block, two vectors of floats; few of the blocks are near. ROW: boxes that are measured at once,
 * as many as a copy of 1,000 vertices has, which is searched most. GROUPS: groups of a row, as many as one vector holds
 * side by side. */
enum { BLOCK = 16, ROW = 64, GROUPS = 16, COORDINATES = 6 };

static const double NORMAL_WEIGHT = 0.25; /* of |n − n'|² against |x − x'|², areas being 4π */

/* A vertex with its coordinates. */
typedef struct point {
  float at[COORDINATES];
  int32_t vertex;
} point;

/* A run of points that is split where it is longer than a block. */
typedef struct run {
  int32_t begin, end;
} run;

static int widest_of(const point *list, int32_t count) {
  int widest = 0;
  float width = -1;
  for (int k = 0; k < COORDINATES; k++) {
    float least = list[0].at[k], greatest = least;
    for (int32_t i = 1; i < count; i++) {
      least = list[i].at[k] < least ? list[i].at[k] : least;
      greatest = list[i].at[k] > greatest ? list[i].at[k] : greatest;
    }
    widest = greatest - least > width ? k : widest;
    width = greatest - least > width ? greatest - least : width;
  }
  return widest;
}

/* Puts the points that come first by coordinate k before `middle`, the others behind (Hoare 1961). */
static void part(point *list, int32_t count, int32_t middle, int k) {
  for (int32_t begin = 0, end = count - 1; begin < end;) {
    const float pivot = list[begin + (end - begin) / 2].at[k];
    int32_t i = begin, j = end;
    while (i <= j) {
      while (list[i].at[k] < pivot) {
        i++;
      }
      while (list[j].at[k] > pivot) {
        j--;
      }
      if (i <= j) {
        const point other = list[i];
        list[i++] = list[j];
        list[j--] = other;
      }
    }
    begin = middle >= i ? i : begin;
    end = middle <= j ? j : end;
    if (middle > j && middle < i) {
      return;
    }
  }
}

/* Orders points so that each block has near ones: the widest coordinate of a run is halved until the runs are blocks.
 */
static void order_points(point *list, int32_t count) {
  run stack[32] = {{0, count}}; /* the longer half waits, so a run in it has at most half of the one before */
  for (int depth = 1; depth > 0;) {
    const run one = stack[--depth];
    const int32_t length = one.end - one.begin, middle = (length / 2 + BLOCK - 1) / BLOCK * BLOCK;
    if (length > BLOCK) {
      part(list + one.begin, length, middle, widest_of(list + one.begin, length));
      stack[depth++] = (run){one.begin, one.begin + middle};
      stack[depth++] = (run){one.begin + middle, one.end};
    }
  }
}

static float coordinate_of(const double *position, const double *normal, size_t v, int k) {
  return (float)(k < 3 ? position[3 * v + (size_t)k] : sqrt(NORMAL_WEIGHT) * normal[3 * v + (size_t)(k - 3)]);
}

orb_status orb_searched_create(orb_context *ctx, const double *position, const double *normal, int32_t count,
                               orb_searched *out) {
  out->count = count;
  out->columns = (count + BLOCK - 1) / BLOCK * BLOCK;
  out->boxes = (out->columns / BLOCK + ROW - 1) / ROW * ROW;
  out->order = ORB_NEW(ctx, int32_t, out->columns);
  out->at = ORB_NEW(ctx, float, (size_t)out->columns *COORDINATES);
  out->box = ORB_NEW(ctx, float, (size_t)out->boxes * 2 * COORDINATES);
  out->column = ORB_NEW(ctx, int32_t, count);
  out->whole = ORB_NEW(ctx, float, (size_t)out->boxes / ROW * 2 * COORDINATES);
  point *list = ORB_NEW(ctx, point, count);
  const int fine = out->order && out->at && out->box && out->column && out->whole && list;
  if (fine) {
    for (int32_t v = 0; v < count; v++) {
      list[v].vertex = v;
      for (int k = 0; k < COORDINATES; k++) {
        list[v].at[k] = coordinate_of(position, normal, (size_t)v, k);
      }
    }
    order_points(list, count);
    for (int32_t i = 0; i < count; i++) {
      out->order[i] = list[i].vertex;
      out->column[list[i].vertex] = i;
    }
  }
  orb_free(ctx, list);
  return fine ? ORB_OK : ORB_E_NO_MEMORY;
}

void orb_searched_free(orb_context *ctx, orb_searched *s) {
  orb_free(ctx, s->order);
  orb_free(ctx, s->at);
  orb_free(ctx, s->box);
  orb_free(ctx, s->column);
  orb_free(ctx, s->whole);
  memset(s, 0, sizeof *s);
}

/* The boxes of one coordinate. */
static void fill_boxes(const float *column, orb_searched *out, int coordinate) {
  float *least = out->box + (size_t)coordinate * (size_t)out->boxes;
  float *greatest = least + COORDINATES * (size_t)out->boxes;
  for (int32_t b = 0; b < out->boxes; b++) {
    least[b] = greatest[b] = INFINITY;
    for (int32_t i = b * BLOCK; i < (b + 1) * BLOCK && i < out->count; i++) {
      const int first = i == b * BLOCK;
      least[b] = first || column[i] < least[b] ? column[i] : least[b];
      greatest[b] = first || column[i] > greatest[b] ? column[i] : greatest[b];
    }
  }
}

/* Fits a box around each row of boxes, in one coordinate. */
static void fill_whole(orb_searched *out, int coordinate) {
  const float *least = out->box + (size_t)coordinate * (size_t)out->boxes;
  const float *greatest = least + COORDINATES * (size_t)out->boxes;
  const int32_t rows = out->boxes / ROW, blocks = out->columns / BLOCK;
  for (int32_t r = 0; r < rows; r++) {
    float *low = out->whole + (size_t)coordinate * (size_t)rows + r, *high = low + COORDINATES * (size_t)rows;
    *low = least[r * ROW];
    *high = greatest[r * ROW];
    for (int32_t b = r * ROW + 1; b < (r + 1) * ROW && b < blocks; b++) {
      *low = least[b] < *low ? least[b] : *low;
      *high = greatest[b] > *high ? greatest[b] : *high;
    }
  }
}

void orb_searched_fill(const double *position, const double *normal, orb_searched *out) {
  for (int k = 0; k < COORDINATES; k++) {
    float *column = out->at + (size_t)k * (size_t)out->columns;
    for (int32_t i = 0; i < out->columns; i++) {
      column[i] = i < out->count ? coordinate_of(position, normal, (size_t)out->order[i], k) : INFINITY;
    }
    fill_boxes(column, out, k);
    fill_whole(out, k);
  }
}

/* Squared distances of the vertices of a block. Returns whether one is less than `least`. */
ORB_CLONES static int measure_block(const float *at, int32_t columns, const float q[COORDINATES], float least,
                                    float *out) {
  float sum[BLOCK] = {0};
  for (int k = 0; k < COORDINATES; k++) {
    const float *column = at + k * (ptrdiff_t)columns;
    for (int i = 0; i < BLOCK; i++) {
      float d = column[i] - q[k];
      sum[i] += d * d;
    }
  }
  int is_nearer = 0;
  for (int i = 0; i < BLOCK; i++) {
    is_nearer |= sum[i] < least;
  }
  memcpy(out, sum, sizeof sum);
  return is_nearer;
}

/* Squared distances of a row of boxes. Group g has the boxes g, g + GROUPS, … */
typedef struct row_distances {
  float box[ROW], least[GROUPS];
} row_distances;

/* Squared distances of a row of boxes, and the least of each group. No vertex of a box is nearer, also by rounded sums:
 * each operation rounds monotonically, and both add in the same order. */
ORB_CLONES static void measure_boxes(const float *box, int32_t boxes, const float q[COORDINATES], row_distances *out) {
  float sum[ROW] = {0};
  for (int k = 0; k < COORDINATES; k++) {
    const float *least = box + k * (ptrdiff_t)boxes, *greatest = least + COORDINATES * (ptrdiff_t)boxes;
    for (int i = 0; i < ROW; i++) {
      float below = least[i] - q[k], above = q[k] - greatest[i];
      float d = below > above ? below : above;
      d = d > 0 ? d : 0;
      sum[i] += d * d;
    }
  }
  for (int g = 0; g < GROUPS; g++) {
    float least = sum[g];
    for (int i = g + GROUPS; i < ROW; i += GROUPS) {
      least = sum[i] < least ? sum[i] : least;
    }
    out->least[g] = least;
  }
  memcpy(out->box, sum, sizeof sum);
}

/* Updates the nearest vertex so far by those of a block. */
static void look_at_block(const orb_searched *s, int32_t block, const float q[COORDINATES], float *least,
                          int32_t *best) {
  float distance[BLOCK];
  const int is_nearer = measure_block(s->at + block * BLOCK, s->columns, q, *least, distance);
  for (int i = 0; is_nearer && i < BLOCK; i++) {
    *best = distance[i] < *least ? block * BLOCK + i : *best;
    *least = distance[i] < *least ? distance[i] : *least;
  }
}

static int nearest_box(const row_distances *d) {
  int group = 0;
  for (int g = 1; g < GROUPS; g++) {
    group = d->least[g] < d->least[group] ? g : group;
  }
  int nearest = group;
  for (int i = group + GROUPS; i < ROW; i += GROUPS) {
    nearest = d->box[i] < d->box[nearest] ? i : nearest;
  }
  return nearest;
}

/* The squared distance to the box around a row of boxes. No vertex in the row is nearer. */
static float distance_of_row(const orb_searched *s, int32_t row, const float q[COORDINATES]) {
  const int32_t rows = s->boxes / ROW;
  float sum = 0;
  for (int k = 0; k < COORDINATES; k++) {
    const float *least = s->whole + (ptrdiff_t)k * rows + row, *greatest = least + (ptrdiff_t)COORDINATES * rows;
    const float below = *least - q[k], above = q[k] - *greatest;
    const float d = below > above ? below : above;
    sum += d > 0 ? d * d : 0;
  }
  return sum;
}

static void look_at_row(const orb_searched *s, int32_t row, const float q[COORDINATES], float *least, int32_t *best) {
  row_distances d;
  measure_boxes(s->box + row * ROW, s->boxes, q, &d);
  const int first = nearest_box(&d);
  if (d.box[first] < *least) {
    look_at_block(s, row * ROW + first, q, least, best);
  }
  for (int g = 0; g < GROUPS; g++) {
    for (int i = g; i < ROW && d.least[g] < *least; i += GROUPS) {
      if (d.box[i] < *least && i != first) {
        look_at_block(s, row * ROW + i, q, least, best);
      }
    }
  }
}

int32_t orb_searched_nearest(const orb_searched *s, const double x[3], const double n[3], int32_t hint) {
  float q[COORDINATES], least = INFINITY;
  int32_t best = 0;
  for (int k = 0; k < COORDINATES; k++) {
    q[k] = coordinate_of(x, n, 0, k);
  }
  if (hint >= 0) {
    best = s->column[hint];
    least = 0;
    for (int k = 0; k < COORDINATES; k++) {
      const float d = s->at[(ptrdiff_t)k * s->columns + best] - q[k];
      least += d * d;
    }
  }
  for (int32_t row = 0; row < s->boxes / ROW; row++) {
    if (distance_of_row(s, row, q) < least) {
      look_at_row(s, row, q, &least, &best);
    }
  }
  return s->order[best];
}
