/* Straight paths over the fixed shape: orb_map_surface_trace() in the coordinates of the triangles, without positions.
 */
#include "align/map/engine/vector/jobs.h"

/* A point on its way: where it is, and the rest of the step along the tangents there. */
typedef struct step_path {
  int32_t triangle;
  int came; /* the corner opposite to the edge that was crossed; −1: none yet */
  double at[3], rest[2];
} step_path;

/* Walks to the end of the step or to an edge of the triangle; returns the corner opposite to that edge, −1: none. */
static inline int path_advance(const double *rate_of, step_path *p) {
  double rate[3], reach = 1, speed = 1;
  int leave = -1;
  rate[1] = rate_of[0] * p->rest[0] + rate_of[1] * p->rest[1];
  rate[2] = rate_of[2] * p->rest[0] + rate_of[3] * p->rest[1];
  rate[0] = -rate[1] - rate[2];
  for (int k = 0; k < 3; k++) { /* the least at/−rate, compared without divisions */
    if (k != p->came && rate[k] < 0 && p->at[k] * speed < -rate[k] * reach) {
      reach = p->at[k];
      speed = -rate[k];
      leave = k;
    }
  }
  double part = leave < 0 ? 1 : reach / speed;
  for (int k = 0; k < 3; k++) {
    double at = p->at[k] + part * rate[k];
    p->at[k] = at > 0 && k != leave ? at : 0;
  }
  p->rest[0] *= 1 - part;
  p->rest[1] *= 1 - part;
  return leave;
}

/* Crosses the edge opposite to corner `leave`. */
static inline void path_cross(const orb_map_packed *fixed, int leave, step_path *p) {
  int i = leave == 2 ? 0 : leave + 1, j = i == 2 ? 0 : i + 1;
  int64_t h = 3 * (int64_t)p->triangle + i;
  int32_t twin = fixed->b.twin[h], k = twin % 3; /* it runs from corner j to corner i */
  double c = fixed->rotation[2 * h], s = fixed->rotation[2 * h + 1], at[3] = {0, 0, 0};
  at[k] = p->at[j];
  at[k == 2 ? 0 : k + 1] = p->at[i];
  p->came = k == 0 ? 2 : k - 1;
  p->triangle = twin / 3;
  memcpy(p->at, at, sizeof at);
  double r0 = p->rest[0], r1 = p->rest[1];
  p->rest[0] = c * r0 - s * r1;
  p->rest[1] = s * r0 + c * r1;
}

/* Walks to the end of the step; 0 if there is none. The sum of p->at is 1 up to rounding. */
static inline int path_end(const orb_map_packed *fixed, step_path *p) {
  for (int crossing = 0; crossing < ORB_MAP_CROSSINGS; crossing++) {
    const double *rate = fixed->triangle_row + ORB_MAP_ROW * (int64_t)p->triangle;
    if (isnan(rate[0])) {
      return 0;
    }
    int leave = path_advance(rate, p);
    if (leave < 0) {
      return 1;
    }
    path_cross(fixed, leave, p);
  }
  return 0;
}
