#include "view_aim.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "view_base.h"
#include "view_legs.h"
#include "view_pose.h"

enum {
  CELLS = 24,    /* of the grid along each axis of the bounding box */
  SAMPLES = 8,   /* points of a triangle along each edge */
  YAW_STEP = 5,  /* degrees */
  DEPTH_YAW = 22 /* degrees away from the largest side */
};
/* A mirror image has to fill this much more of the same cells along one axis than along the others. */
static const double CLEARLY_MIRRORED = 0.15;
static const double MIRRORED = 0.35;
/* Of two sides whose areas differ by less, the one nearer to the front shows. */
static const double ALIKE = 0.01;
/* Flatter than this, relative to the largest extent, a shape has no cells to count. */
static const double FLAT = 0.02;

typedef struct grid {
  unsigned char cell[CELLS][CELLS][CELLS]; /* x, y, z: the surface passes through */
} grid;

static int fill(const view_mesh *mesh, grid *out) {
  float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY}, most = 0;
  memset(out, 0, sizeof *out);
  for (uint32_t i = 0; i < mesh->index_count; i++) {
    for (int k = 0; k < 3; k++) {
      float x = mesh->positions[3 * (size_t)mesh->indices[i] + (size_t)k];
      low[k] = fminf(low[k], x);
      high[k] = fmaxf(high[k], x);
      most = fmaxf(most, high[k] - low[k]);
    }
  }
  for (int k = 0; k < 3; k++) {
    if (!(high[k] - low[k] > (float)FLAT * most)) {
      return 0;
    }
  }
  for (uint32_t i = 0; i + 2 < mesh->index_count; i += 3) {
    for (int a = 0; a <= SAMPLES; a++) {
      for (int b = 0; a + b <= SAMPLES; b++) {
        int at[3];
        for (int k = 0; k < 3; k++) {
          const float *p = mesh->positions + k;
          float x = ((float)a * p[3 * (size_t)mesh->indices[i]] + (float)b * p[3 * (size_t)mesh->indices[i + 1]] +
                     (float)(SAMPLES - a - b) * p[3 * (size_t)mesh->indices[i + 2]]) /
                    SAMPLES;
          int cell = (int)((x - low[k]) / (high[k] - low[k]) * CELLS);
          at[k] = cell < 0 ? 0 : cell >= CELLS ? CELLS - 1 : cell;
        }
        out->cell[at[0]][at[1]][at[2]] = 1;
      }
    }
  }
  return 1;
}

static int full(const grid *g, const int at[3]) {
  return g->cell[at[0]][at[1]][at[2]];
}

/* The cells that the shape and its mirror image along an axis share, as a fraction of those that either fills. */
static double mirrored(const grid *g, int axis) {
  int both = 0, either = 0;
  for (int i = 0; i < CELLS * CELLS * CELLS; i++) {
    int at[3] = {i / (CELLS * CELLS), i / CELLS % CELLS, i % CELLS}, other[3];
    memcpy(other, at, sizeof at);
    other[axis] = CELLS - 1 - at[axis];
    both += full(g, at) && full(g, other);
    either += full(g, at) || full(g, other);
  }
  return either ? (double)both / either : 0;
}

/* The number of feet on which the shape stands if this end of the axis is down: separate spots beside the plane in
 * which `across` mirrors the shape. 0 if the shape touches the ground on that plane, as one does that lies down. */
static int feet(const grid *g, int axis, int high_end, int across) {
  unsigned char floor[CELLS][CELLS] = {{0}};
  int stack[CELLS * CELLS], count = 0;
  for (int u = 0; u < CELLS; u++) {
    for (int v = 0; v < CELLS; v++) {
      int at[3];
      at[axis] = high_end ? CELLS - 1 : 0;
      at[(axis + 1) % 3] = u;
      at[(axis + 2) % 3] = v;
      floor[u][v] = (unsigned char)full(g, at);
      if (floor[u][v] && (at[across] == CELLS / 2 - 1 || at[across] == CELLS / 2)) {
        return 0;
      }
    }
  }
  for (int i = 0; i < CELLS * CELLS; i++) {
    int height = 0;
    if (!floor[i / CELLS][i % CELLS]) {
      continue;
    }
    count++;
    floor[i / CELLS][i % CELLS] = 0;
    for (stack[height++] = i; height;) {
      int at = stack[--height];
      for (int d = 0; d < 9; d++) {
        int u = at / CELLS + d / 3 - 1, v = at % CELLS + d % 3 - 1;
        if (u >= 0 && u < CELLS && v >= 0 && v < CELLS && floor[u][v]) {
          floor[u][v] = 0;
          stack[height++] = u * CELLS + v;
        }
      }
    }
  }
  return count;
}

/* The way up of a mirrored body on this many feet that lies; 0: none. */
static char find_standing(const grid *g, int across, int legs) {
  for (size_t i = 0; i < VIEW_WAYS; i++) {
    if (view_ways[i].axis != across && feet(g, view_ways[i].axis, view_ways[i].high_end, across) == legs) {
      return view_ways[i].up;
    }
  }
  return 0;
}

/* The way up, and what says so; 0: nothing does. */
static char find_up(const view_mesh *mesh, view_sign *sign) {
  grid g;
  char up = 0;
  *sign = VIEW_BY_NOTHING;
  if (!fill(mesh, &g)) {
    return 0;
  }
  double mirror[3] = {mirrored(&g, 0), mirrored(&g, 1), mirrored(&g, 2)};
  int sideways = mirror[1] > mirror[0] + CLEARLY_MIRRORED && mirror[1] > mirror[2] + CLEARLY_MIRRORED;
  int across = sideways ? 1 : mirror[0] >= mirror[2] ? 0 : 2;
  const int is_mirrored = mirror[across] >= MIRRORED;
  const int below = is_mirrored && !sideways ? feet(&g, 1, 0, across) : 0;
  const int stands = below || (is_mirrored && !sideways && feet(&g, 1, 1, across));
  const int lies = is_mirrored && !stands;
  *sign = VIEW_BY_FEET;
  if ((lies && (up = find_standing(&g, across, 4)) != 0) || (below == 4 && (up = 'y') != 0)) {
    return up;
  }
  *sign = VIEW_BY_LEGS;
  const char biped = view_find_biped(mesh, is_mirrored && sideways);
  if (biped && biped != 'y') {
    return biped;
  }
  *sign = VIEW_BY_BASE;
  if ((up = view_find_base(mesh)) != 0) {
    return up;
  }
  *sign = VIEW_BY_LEGS;
  if (biped) {
    return biped;
  }
  *sign = VIEW_BY_FEET;
  if ((lies && (up = find_standing(&g, across, 2)) != 0 && !view_is_thin(mesh, up)) || (below && (up = 'y') != 0)) {
    return up;
  }
  *sign = VIEW_BY_HORNS;
  if ((up = view_find_horns(mesh)) != 0) {
    return up;
  }
  *sign = VIEW_BY_NOTHING;
  return 0;
}

/* Twice the area that the shapes show from a direction, since half of a closed surface faces the viewer. */
static double shown(const view_mesh *mesh, const double to[3]) {
  double sum = 0;
  for (int shape = 0; shape < view_shape_count(mesh); shape++) {
    const float *delta = shape ? mesh->delta_positions + 3 * (size_t)mesh->vertex_count * (size_t)(shape - 1) : NULL;
    for (uint32_t i = 0; i + 2 < mesh->index_count; i += 3) {
      double p[3][3], cross = 0;
      for (int c = 0; c < 3; c++) {
        for (int k = 0; k < 3; k++) {
          size_t at = 3 * (size_t)mesh->indices[i + (uint32_t)c] + (size_t)k;
          p[c][k] = (double)mesh->positions[at] + (delta ? (double)delta[at] : 0);
        }
      }
      for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        cross += to[k] * ((p[1][u] - p[0][u]) * (p[2][v] - p[0][v]) - (p[1][v] - p[0][v]) * (p[2][u] - p[0][u]));
      }
      sum += fabs(cross);
    }
  }
  return sum;
}

/* The same for a rotation around the up axis, in degrees. */
static double shown_at(const view_mesh *mesh, view_rotation rotation, double degrees) {
  const double angle = degrees * 3.14159265358979 / 180;
  double to[3];
  for (int k = 0; k < 3; k++) {
    to[k] = sin(angle) * rotation[0][k] + cos(angle) * rotation[2][k];
  }
  return shown(mesh, to);
}

static double find_yaw(const view_mesh *mesh, char up) {
  view_rotation rotation;
  double best = 0, yaw = 0;
  view_upright(up, rotation);
  for (int degrees = -90; degrees < 90; degrees += YAW_STEP) {
    double area = shown_at(mesh, rotation, degrees);
    /* of sides of nearly the same area, prefer the one nearer to the front */
    if (area > 1.001 * best || (area > 0.999 * best && abs(degrees) < fabs(yaw))) {
      best = fmax(area, best);
      yaw = degrees;
    }
  }
  const double less = shown_at(mesh, rotation, yaw - DEPTH_YAW), more = shown_at(mesh, rotation, yaw + DEPTH_YAW);
  if (fabs(less - more) > ALIKE * fmax(less, more)) {
    return less > more ? yaw - DEPTH_YAW : yaw + DEPTH_YAW;
  }
  return yaw > 0 ? yaw - DEPTH_YAW : yaw + DEPTH_YAW;
}

void view_aim(const view_mesh *mesh, view_options *options) {
  if (!options->up) {
    const char up = find_up(mesh, &options->sign);
    options->up = up ? up : 'y';
  }
  if (isnan(options->yaw)) {
    options->yaw = find_yaw(mesh, options->up);
  }
}
