#include "transfer/fit.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"
#include "transfer/rotation.h"

/* Height over length below which points count as lying on a line: a rotation about it would be arbitrary. */
static const double FLAT = 1e-3;
/* AUTO: frames clearly differ beyond any of these. Units (of powers of ten, inches) differ by 2.54 or more and axes by
 * 90°; shapes that were modelled in one frame rarely differ by this much. */
static const double SCALE_DIFFERS = 1.5, DEGREES_DIFFER = 30, DIAGONALS_DIFFER = 0.5;
/* AUTO: a shape keeps its posture where that makes the sum of squared distances at most this many times as large: of a
 * dog and a giraffe 1.5 (15°), of an armadillo and a penguin 1.4 (21°). Copies of one shape have no such distances. */
static const double POSTURE_WORSE = 2;
/* AUTO_UNSURE: a fit that leaves less than this share of the spread is one of a shape to its like, such as two
 * cylinders, whichever parts correspond. Copies leave 0.001, a cow whose head went to a hind leg 0.03. */
static const double LIKE = 0.01;
/* AUTO_UNSURE: files have other axes where right angles lie this near to the best rotation, in degrees, leave at most
 * this share of the spread, and of the squared distances that no rotation leaves. Animals and people whose match is
 * right but unsure, with z up, have 2° to 13°, 0.02 to 0.11 and 0.02 to 0.17. Matches whose head goes to a leg have 27°
 * to 41°; where a man stands along the back of a dog, 15° to 19° and 0.16 to 0.2 of the spread. */
static const double AXES_DEGREES = 15, AXES_OFF = 0.13, AXES_LEFT = 0.25;
/* AUTO_UNSURE: a shape is rotated if its places correspond to opposite ones of the first shape, and rotating leaves
 * little, or leaves the shape upright. Opposite: without a rotation, the squared distances are this many times the
 * spread or more, so that the shape shrinks to two fifths of its spread on the way, or less. Little: at most this share
 * of the spread. Upright: its y axis within these degrees. First guesses, looked at on a tetrahedron and an icosahedron
 * (1.32, 0.05 and 125°) and on a boat and an armadillo, which stay (0.68). */
static const double OPPOSITE = 1.2, OPPOSITE_OFF = 0.1, OPPOSITE_UP = 60;

/* Weighted points of both shapes. index NULL: all vertices; weight NULL: 1. */
typedef struct fit_points {
  const double *fixed, *moved, *weight;
  const int32_t *index;
  int32_t count;
} fit_points;

static int32_t point_of(const fit_points *points, int32_t i) {
  return points->index ? points->index[i] : i;
}

static void mean_of(const fit_points *points, const double *positions, double out[3]) {
  double sum[3] = {0}, total = 0;
  for (int32_t i = 0; i < points->count; i++) {
    double w = points->weight ? points->weight[i] : 1;
    const double *p = positions + 3 * (int64_t)point_of(points, i);
    for (int c = 0; c < 3; c++) {
      sum[c] += w * p[c];
    }
    total += w;
  }
  for (int c = 0; c < 3; c++) {
    out[c] = total > 0 ? sum[c] / total : 0;
  }
}

/* Whether the points of a shape clearly do not lie on a line: tests the largest triangle over point 0 and the point
 * farthest from it, `widest` being twice its area. */
static int spans_plane(const fit_points *points, const double *positions) {
  double longest = 0, widest = 0;
  const double *a = positions + 3 * (int64_t)point_of(points, 0), *b = a;
  for (int32_t i = 1; i < points->count; i++) {
    const double *p = positions + 3 * (int64_t)point_of(points, i);
    if (orb_distance2(a, p) > longest) {
      longest = orb_distance2(a, p);
      b = p;
    }
  }
  for (int32_t i = 1; i < points->count; i++) {
    double u[3], w[3], n[3];
    orb_sub(b, a, u);
    orb_sub(positions + 3 * (int64_t)point_of(points, i), a, w);
    orb_cross(u, w, n);
    widest = fmax(widest, orb_length(n));
  }
  return widest > FLAT * longest;
}

static void add_areas(const orb_supermesh *supermesh, const double *positions, double *weight) {
  double total = 0;
  for (int pass = 0; pass < 2; pass++) {
    for (int32_t t = 0; t < supermesh->triangle_count; t++) {
      const int32_t *corner = supermesh->triangles + 3 * (int64_t)t;
      double u[3], w[3], n[3];
      orb_sub(positions + 3 * (int64_t)corner[1], positions + 3 * (int64_t)corner[0], u);
      orb_sub(positions + 3 * (int64_t)corner[2], positions + 3 * (int64_t)corner[0], w);
      orb_cross(u, w, n);
      double area = orb_length(n);
      if (pass == 0) {
        total += area;
      } else if (total > 0) {
        for (int k = 0; k < 3; k++) {
          weight[corner[k]] += area / total;
        }
      }
    }
  }
}

/* Σ w b·Ra. */
static double overlap(double rotation[3][3], double h[3][3]) {
  double sum = 0;
  for (int r = 0; r < 3; r++) {
    for (int c = 0; c < 3; c++) {
      sum += rotation[r][c] * h[c][r];
    }
  }
  return sum;
}

/* The rotation by right angles that is nearest to a rotation: of the 24 that carry the axes onto axes. */
static void nearest_right_angles(double rotation[3][3], double out[3][3]) {
  static const int order[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};
  double most = -INFINITY;
  for (int k = 0; k < 24; k++) {
    const int *axis = order[k / 4], odd = k >= 12;
    double sign[3] = {k & 1 ? -1 : 1, k & 2 ? -1 : 1, 1}, sum = 0;
    sign[2] = sign[0] * sign[1] * (odd ? -1 : 1);
    for (int r = 0; r < 3; r++) {
      sum += sign[r] * rotation[r][axis[r]];
    }
    if (sum > most) {
      most = sum;
      memset(out, 0, 9 * sizeof(double));
      for (int r = 0; r < 3; r++) {
        out[r][axis[r]] = sign[r];
      }
    }
  }
}

/* The axes of files differ by right angles. The rest of a rotation, if it is too small to be a difference of frames,
 * comes from the shapes' postures; without it a shape stands as upright as in its file. Copies of one shape fit far
 * worse without the rest, and keep it. If the correspondence may be wrong, the whole rotation may be wrong too, unless
 * it is clearly that of other axes, or the shape would collapse on the way without it. spread: Σ w b·b. */
static void drop_posture(double rotation[3][3], double h[3][3], double scale, double spread, orb_fit fit) {
  static const double stay[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  double right[3][3], trace = 0;
  nearest_right_angles(rotation, right);
  for (int i = 0; i < 9; i++) {
    trace += right[i / 3][i % 3] * rotation[i / 3][i % 3];
  }
  const double degrees = acos(fmax(-1, fmin(1, (trace - 1) / 2))) * 180 / M_PI;
  const double off = spread - scale * overlap(rotation, h), right_off = spread - scale * overlap(right, h);
  const double stay_off = spread - scale * (h[0][0] + h[1][1] + h[2][2]);
  const int is_axes = degrees <= AXES_DEGREES && right_off <= AXES_OFF * spread && right_off <= AXES_LEFT * stay_off;
  const int is_opposite = stay_off >= OPPOSITE * spread &&
                          (off <= OPPOSITE_OFF * spread || rotation[1][1] >= cos(OPPOSITE_UP * M_PI / 180));
  if (fit == ORB_FIT_AUTO_UNSURE && off > LIKE * spread && !is_axes && !is_opposite) {
    memcpy(rotation, stay, sizeof stay);
  } else if (degrees <= DEGREES_DIFFER && right_off <= POSTURE_WORSE * off) {
    memcpy(rotation, right, sizeof right);
  }
}

static int is_auto(orb_fit fit) {
  return fit == ORB_FIT_AUTO || fit == ORB_FIT_AUTO_UNSURE;
}

static void solve(const fit_points *points, orb_fit fit, orb_motion *out) {
  double fixed[3], moved[3], h[3][3] = {{0}}, spread_fixed = 0, spread_moved = 0, q[4], rotation[3][3];
  mean_of(points, points->fixed, fixed);
  mean_of(points, points->moved, moved);
  for (int32_t i = 0; i < points->count; i++) {
    double w = points->weight ? points->weight[i] : 1, a[3], b[3];
    orb_sub(points->moved + 3 * (int64_t)point_of(points, i), moved, a);
    orb_sub(points->fixed + 3 * (int64_t)point_of(points, i), fixed, b);
    for (int r = 0; r < 3; r++) {
      for (int c = 0; c < 3; c++) {
        h[r][c] += w * a[r] * b[c];
      }
    }
    spread_moved += w * orb_dot(a, a);
    spread_fixed += w * orb_dot(b, b);
  }
  orb_rotation_fit(h, q);
  orb_rotation_matrix(q, rotation);
  out->scale = fit != ORB_FIT_RIGID && spread_moved > 0 && spread_fixed > 0 ? sqrt(spread_fixed / spread_moved) : 1;
  out->moves = sqrt(orb_distance2(fixed, moved));
  if (is_auto(fit)) {
    drop_posture(rotation, h, out->scale, spread_fixed, fit);
  }
  memcpy(out->rotation, rotation, sizeof rotation);
  for (int c = 0; c < 3; c++) {
    out->shift[c] = fixed[c] - out->scale * orb_dot(out->rotation[c], moved);
  }
}

double orb_motion_degrees(const orb_motion *motion) {
  double trace = motion->rotation[0][0] + motion->rotation[1][1] + motion->rotation[2][2];
  return acos(fmax(-1, fmin(1, (trace - 1) / 2))) * 180 / M_PI;
}

double orb_fit_diagonal(const double *positions, int32_t count) {
  double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
  for (int64_t i = 0; i < 3 * (int64_t)count; i++) {
    low[i % 3] = fmin(low[i % 3], positions[i]);
    high[i % 3] = fmax(high[i % 3], positions[i]);
  }
  return sqrt(orb_distance2(low, high));
}

static int frames_differ(const orb_motion *motion, double diagonal) {
  return motion->scale > SCALE_DIFFERS || motion->scale < 1 / SCALE_DIFFERS ||
         orb_motion_degrees(motion) > DEGREES_DIFFER || motion->moves > DIAGONALS_DIFFER * diagonal;
}

orb_status orb_fit_motion(orb_context *ctx, const orb_supermesh *supermesh, const double *fixed, const double *moved,
                          orb_fit fit, orb_motion *out) {
  const orb_motion stay = {.rotation = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, .scale = 1};
  *out = stay;
  if (fit == ORB_FIT_NONE) {
    return ORB_OK;
  }
  fit_points points = {fixed, moved, NULL, NULL, supermesh->vertex_count};
  int32_t *index = ORB_NEW(ctx, int32_t, supermesh->landmark_count);
  double *weight = ORB_NEW0(ctx, double, supermesh->vertex_count);
  orb_status status = index && weight ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    int32_t count = 0;
    for (int32_t i = 0; i < supermesh->landmark_count; i++) {
      if (supermesh->landmark_vertices[i] >= 0) {
        index[count++] = supermesh->landmark_vertices[i];
      }
    }
    fit_points landmarks = {fixed, moved, NULL, index, count};
    if (count >= 3 && spans_plane(&landmarks, fixed) && spans_plane(&landmarks, moved)) {
      points = landmarks;
    } else {
      add_areas(supermesh, fixed, weight);
      add_areas(supermesh, moved, weight);
      points.weight = weight;
    }
    out->kind = fit == ORB_FIT_RIGID ? ORB_FIT_RIGID : ORB_FIT_SIMILARITY;
    solve(&points, fit, out);
    if (is_auto(fit) && !frames_differ(out, orb_fit_diagonal(fixed, supermesh->vertex_count))) {
      *out = stay;
    }
  }
  orb_free(ctx, index);
  orb_free(ctx, weight);
  return status;
}

void orb_motion_apply(const orb_motion *motion, double *positions, int32_t count) {
  for (int32_t i = 0; i < count; i++) {
    double *p = positions + 3 * (int64_t)i, from[3] = {p[0], p[1], p[2]};
    for (int c = 0; c < 3; c++) {
      p[c] = motion->scale * orb_dot(motion->rotation[c], from) + motion->shift[c];
    }
  }
}

void orb_motion_rotate(const orb_motion *motion, float *vectors, int32_t count) {
  for (int32_t i = 0; i < count; i++) {
    float *v = vectors + 3 * (int64_t)i;
    double from[3] = {(double)v[0], (double)v[1], (double)v[2]};
    for (int c = 0; c < 3; c++) {
      v[c] = (float)orb_dot(motion->rotation[c], from) + 0.0f;
    }
  }
}
