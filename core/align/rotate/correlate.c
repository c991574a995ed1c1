/* Rotation search without landmarks.
 *
 * The embeddings of two similar shapes differ mostly by a rotation of the sphere: after it, each direction of the
 * sphere has the same position and normal on both shapes. These are averaged into the cells of a cube map, and for a
 * rotation R of the sphere the 3×3 cross-covariance M(R) of the two fields is summed. The rotation in space that fits R
 * best is the Procrustes solution of M(R), and the sum of its singular values says how near the map through the sphere
 * is to a rigid motion. The search evaluates a grid of rotations, and then refines the best few by a shrinking local
 * search.
 */
#include <math.h>
#include <string.h>

#include "align/rotate/correlate.h"
#include "align/rotate/procrustes.h"
#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

/* Chosen by trial. */
enum {
  SIDE = 12, /* cells along an edge of the cube map: 7.5° each */
  CELLS = 6 * SIDE * SIDE,
  FIELD = 6,  /* numbers of a cell: position and normal */
  AXES = 200, /* poles of the grid of rotations, about 14° apart */
  SPINS = 24, /* rotations around each pole: 15° apart */
  STARTS = 12 /* grid points that are refined */
};
static const double APART = 0.8;   /* radians: rotations this far apart are different candidates */
static const double NORMALS = 0.3; /* variance of the normals where that of the positions is 1 */
static const double FIRST_STEP = 0.12, LAST_STEP = 0.002; /* radians of the pattern search */
enum { MOVES = 8 };                                       /* most rounds of it with one step */
static const double UPRIGHT = 0.15; /* relative: an upright rotation may score less than the best by this share */
static const double GOLDEN_ANGLE = 2.399963229728653; /* π (3 − √5): between neighbours of a Fibonacci lattice */

/* Mean position (centred, unit variance) and normal (variance NORMALS) of each cell of the cube map. */
typedef struct field {
  double direction[CELLS][3], weight[CELLS], value[CELLS][FIELD];
} field;

static int32_t cell_of(const double p[3]) {
  double x = fabs(p[0]), y = fabs(p[1]), z = fabs(p[2]);
  int axis = x >= y ? (x >= z ? 0 : 2) : (y >= z ? 1 : 2);
  double m = fabs(p[axis]), inverse = m > 0 ? 1 / m : 0;
  double u = p[(axis + 1) % 3] * inverse, v = p[(axis + 2) % 3] * inverse;
  int i = (int)((u + 1) * 0.5 * SIDE), j = (int)((v + 1) * 0.5 * SIDE);
  i = i < 0 ? 0 : i >= SIDE ? SIDE - 1 : i;
  j = j < 0 ? 0 : j >= SIDE ? SIDE - 1 : j;
  return ((2 * axis + (p[axis] < 0)) * SIDE + i) * SIDE + j;
}

static void cell_direction(int32_t cell, double out[3]) {
  int j = cell % SIDE, i = cell / SIDE % SIDE, side = cell / (SIDE * SIDE), axis = side / 2;
  out[axis] = side % 2 ? -1 : 1;
  out[(axis + 1) % 3] = (2 * i + 1.0) / SIDE - 1;
  out[(axis + 2) % 3] = (2 * j + 1.0) / SIDE - 1;
  orb_normalize(out);
}

/* Adds one triangle to its cells, in n² equal parts that are small enough to skip no cell. */
static void splat(field *f, const orb_aligned_shape *shape, int32_t t) {
  const double *p[3], *x[3];
  for (int k = 0; k < 3; k++) {
    size_t v = 3 * (size_t)shape->mesh.triangles[3 * (size_t)t + (size_t)k];
    p[k] = shape->points + v;
    x[k] = shape->mesh.positions + v;
  }
  double u[3], w[3], normal[3], longest = 0;
  orb_sub(x[1], x[0], u);
  orb_sub(x[2], x[0], w);
  orb_cross(u, w, normal);
  orb_normalize(normal);
  for (int k = 0; k < 3; k++) {
    double d = orb_distance2(p[k], p[(k + 1) % 3]);
    longest = d > longest ? d : longest;
  }
  int n = 1 + (int)(sqrt(longest) * 2 * SIDE);
  double area = orb_det(p[0], p[1], p[2]) / (n * n);
  for (int i = 0; i < n; i++) {
    for (int j = 0; j < 2 * (n - i) - 1; j++) {
      double a = (i + (j % 2 ? 2.0 : 1.0) / 3) / n, b = (j / 2 + (j % 2 ? 2.0 : 1.0) / 3) / n, c = 1 - a - b, q[3];
      for (int k = 0; k < 3; k++) {
        q[k] = c * p[0][k] + a * p[1][k] + b * p[2][k];
      }
      double r2 = orb_dot(q, q), density = area / (r2 * sqrt(r2) + 1e-9);
      int32_t cell = cell_of(q);
      f->weight[cell] += density;
      for (int k = 0; k < 3; k++) {
        f->value[cell][k] += density * (c * x[0][k] + a * x[1][k] + b * x[2][k]);
        f->value[cell][3 + k] += density * normal[k];
      }
    }
  }
}

static void field_make(field *f, const orb_aligned_shape *shape) {
  memset(f, 0, sizeof *f);
  for (int32_t t = 0; t < shape->mesh.triangle_count; t++) {
    splat(f, shape, t);
  }
  double mean[3] = {0, 0, 0}, variance = 0, normal_variance = 0, total = 0;
  for (int32_t c = 0; c < CELLS; c++) {
    cell_direction(c, f->direction[c]);
    if (f->weight[c] > 0) {
      for (int k = 0; k < FIELD; k++) {
        f->value[c][k] /= f->weight[c];
      }
      for (int k = 0; k < 3; k++) {
        mean[k] += f->weight[c] * f->value[c][k];
      }
      total += f->weight[c];
    }
  }
  for (int32_t c = 0; c < CELLS; c++) {
    for (int k = 0; k < 3; k++) {
      f->value[c][k] -= mean[k] / total;
      variance += f->weight[c] * f->value[c][k] * f->value[c][k];
      normal_variance += f->weight[c] * f->value[c][3 + k] * f->value[c][3 + k];
    }
  }
  double scale = sqrt(total / (variance + 1e-300)), scale_normal = sqrt(NORMALS * total / (normal_variance + 1e-300));
  for (int32_t c = 0; c < CELLS; c++) {
    f->weight[c] /= total;
    for (int k = 0; k < 3; k++) {
      f->value[c][k] *= f->weight[c] > 0 ? scale : 0;
      f->value[c][3 + k] *= f->weight[c] > 0 ? scale_normal : 0;
    }
  }
}

typedef struct search {
  const field *a, *b;
  orb_context *ctx;
  const double *from, *to; /* landmarks that should meet */
  int32_t marks;
  int spaced; /* starts that are far from each other are wanted */
} search;

/* The mean squared distance that a rotation leaves between the landmarks. */
static double misfit(const search *s, const double r[9]) {
  double sum = 0;
  for (int32_t k = 0; k < s->marks; k++) {
    double p[3];
    orb_rotate_point(r, s->from + 3 * (size_t)k, p);
    sum += orb_distance2(p, s->to + 3 * (size_t)k);
  }
  return s->marks > 0 ? sum / s->marks : 0;
}

/* Correlation of a with b rotated on the sphere: *upright without, *best with the best rotation in space. */
static orb_status score_of(const search *s, const double r[9], double *upright, double *best) {
  double m[9] = {0};
  for (int32_t c = 0; c < CELLS; c++) {
    const double *d = s->a->direction[c];
    /* what R carries to d lies at Rᵀ d */
    double q[3] = {r[0] * d[0] + r[3] * d[1] + r[6] * d[2], r[1] * d[0] + r[4] * d[1] + r[7] * d[2],
                   r[2] * d[0] + r[5] * d[1] + r[8] * d[2]};
    const double *fa = s->a->value[c], *fb = s->b->value[cell_of(q)];
    double w = s->a->weight[c];
    for (int i = 0; i < 3; i++) {
      for (int j = 0; j < 3; j++) {
        m[3 * i + j] += w * (fb[i] * fa[j] + fb[3 + i] * fa[3 + j]);
      }
    }
  }
  double in_space[9], singular[3];
  ORB_TRY(orb_procrustes_covariance(s->ctx, m, in_space, singular));
  double lost = misfit(s, r);
  *upright = (m[0] + m[4] + m[8]) / (1 + NORMALS) - lost;
  *best = (singular[0] + singular[1] + singular[2]) / (1 + NORMALS) - lost;
  return ORB_OK;
}

static void from_quaternion(const double q[4], double r[9]) {
  double w = q[0], x = q[1], y = q[2], z = q[3];
  double m[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                 2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                 2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  memcpy(r, m, sizeof m);
}

static void quaternion_product(const double a[4], const double b[4], double out[4]) {
  double q[4] = {
      a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
      a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
  memcpy(out, q, sizeof q);
}

typedef struct start {
  double q[4], score;
} start;

static int is_near(const double a[4], const double b[4]) {
  return fabs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]) > cos(APART / 2);
}

/* Inserts a rotation into the ordered list. spaced: of rotations that are near each other, only the best stays. */
static void keep_start(start *list, const double q[4], double score, int spaced) {
  int at = STARTS, left = 0;
  for (int i = 0; spaced && i < STARTS; i++) {
    if (list[i].score >= score && is_near(list[i].q, q)) {
      return;
    }
  }
  for (int i = 0; spaced && i < STARTS; i++) {
    if (list[i].score > -INFINITY && !is_near(list[i].q, q)) {
      list[left++] = list[i];
    }
  }
  for (; spaced && left < STARTS; left++) {
    list[left].score = -INFINITY;
  }
  while (at > 0 && list[at - 1].score < score) {
    at--;
  }
  if (at < STARTS) {
    memmove(list + at + 1, list + at, (size_t)(STARTS - 1 - at) * sizeof *list);
    memcpy(list[at].q, q, sizeof list[at].q);
    list[at].score = score;
  }
}

/* A grid over SO(3): a Fibonacci lattice of poles, and rotations around each. */
static orb_status coarse(const search *s, start *upright, start *best) {
  for (int i = 0; i < STARTS; i++) {
    upright[i].score = best[i].score = -INFINITY;
  }
  for (int i = 0; i < AXES; i++) {
    double z = 1 - (2 * i + 1.0) / AXES, angle = i * GOLDEN_ANGLE;
    double half = sqrt((1 + z) / 2), other = sqrt((1 - z) / 2);
    double tilt[4] = {half, -other * sin(angle), other * cos(angle), 0};
    for (int j = 0; j < SPINS; j++) {
      double spin[4] = {cos(M_PI * j / SPINS), 0, 0, sin(M_PI * j / SPINS)}, q[4], r[9], up, any;
      quaternion_product(tilt, spin, q);
      from_quaternion(q, r);
      ORB_TRY(score_of(s, r, &up, &any));
      keep_start(upright, q, up, s->spaced);
      keep_start(best, q, any, s->spaced);
    }
    ORB_TRY(orb_context_check(s->ctx));
  }
  return ORB_OK;
}

/* Pattern search: small rotations around the three axes in both directions, halved until they are tiny. */
static orb_status descend(const search *s, start *from, int use_upright) {
  for (double step = FIRST_STEP; step > LAST_STEP; step /= 2) {
    for (int moved = 1, rounds = 0; moved && rounds < MOVES; rounds++) {
      moved = 0;
      for (int k = 0; k < 6; k++) {
        double spin[4] = {cos(step / 2), 0, 0, 0}, q[4], r[9], up, any;
        spin[1 + k / 2] = k % 2 ? -sin(step / 2) : sin(step / 2);
        quaternion_product(spin, from->q, q);
        from_quaternion(q, r);
        ORB_TRY(score_of(s, r, &up, &any));
        if ((use_upright ? up : any) > from->score) {
          from->score = use_upright ? up : any;
          memcpy(from->q, q, sizeof q);
          moved = 1;
        }
      }
    }
  }
  return orb_context_check(s->ctx);
}

/* Both lists of local maxima, refined. */
static orb_status find_starts(orb_context *ctx, const orb_aligned_shape *a, const orb_aligned_shape *b,
                              const double *from, const double *to, int32_t count, int spaced, start *upright,
                              start *best) {
  orb_status status = ORB_OK;
  field *fa = ORB_NEW(ctx, field, 1), *fb = ORB_NEW(ctx, field, 1);
  if (!fa || !fb) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  field_make(fa, a);
  field_make(fb, b);
  search s = {.a = fa, .b = fb, .ctx = ctx, .from = from, .to = to, .marks = count, .spaced = spaced};
  ORB_GO(status, coarse(&s, upright, best), end);
  for (int i = 0; i < STARTS; i++) {
    if (upright[i].score > -INFINITY) {
      ORB_GO(status, descend(&s, &upright[i], 1), end);
    }
    if (best[i].score > -INFINITY) {
      ORB_GO(status, descend(&s, &best[i], 0), end);
    }
  }
end:
  orb_free(ctx, fa);
  orb_free(ctx, fb);
  return status;
}

/* The best rotation for shapes in one upright frame, unless another explains much more. */
static const start *choose(const start *upright, const start *best) {
  const start *top_upright = upright, *top_best = best;
  for (int i = 1; i < STARTS; i++) {
    top_upright = upright[i].score > top_upright->score ? &upright[i] : top_upright;
    top_best = best[i].score > top_best->score ? &best[i] : top_best;
  }
  return top_upright->score > top_best->score - UPRIGHT * fabs(top_best->score) ? top_upright : top_best;
}

orb_status orb_rotation_search_near(orb_context *ctx, const orb_aligned_shape *a, const orb_aligned_shape *b,
                                    const double *from, const double *to, int32_t count, double rotation[9],
                                    double *score) {
  start upright[STARTS], best[STARTS];
  ORB_TRY(find_starts(ctx, a, b, from, to, count, 0, upright, best));
  const start *chosen = choose(upright, best);
  from_quaternion(chosen->q, rotation);
  if (score) {
    *score = chosen->score;
  }
  return ORB_OK;
}

orb_status orb_rotation_candidates(orb_context *ctx, const orb_aligned_shape *a, const orb_aligned_shape *b,
                                   int32_t most, double *rotations, int32_t *count) {
  start list[2 * STARTS], taken[2 * STARTS];
  ORB_TRY(find_starts(ctx, a, b, NULL, NULL, 0, 0, list, list + STARTS));
  taken[0] = *choose(list, list + STARTS);
  ORB_TRY(find_starts(ctx, a, b, NULL, NULL, 0, 1, list, list + STARTS));
  for (*count = 0; *count < most && *count < 2 * STARTS; ++*count) {
    const start *top = *count ? NULL : taken;
    for (int i = 0; *count && i < 2 * STARTS; i++) {
      int known = 0;
      for (int k = 0; k < *count; k++) {
        known |= is_near(list[i].q, taken[k].q);
      }
      top = !known && list[i].score > -INFINITY && (!top || list[i].score > top->score) ? &list[i] : top;
    }
    if (!top) {
      break;
    }
    taken[*count] = *top;
    from_quaternion(top->q, rotations + 9 * *count);
  }
  return ORB_OK;
}

orb_status orb_rotation_search(orb_context *ctx, const orb_aligned_shape *a, const orb_aligned_shape *b,
                               double rotation[9], double *score) {
  return orb_rotation_search_near(ctx, a, b, NULL, NULL, 0, rotation, score);
}
