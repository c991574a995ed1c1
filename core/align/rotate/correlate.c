/* Rotation search without landmarks.
 *
 * The embeddings of two similar shapes differ mostly by a rotation of the sphere: after it, each direction of the
 * sphere has the same position and normal on both shapes. These are averaged into the cells of a cube map, and for a
 * rotation R of the sphere the 3×3 cross-covariance M(R) of the two fields is summed. The rotation in space that fits R
 * best is the Procrustes solution of M(R), and the sum of its singular values says how near the map through the sphere
 * is to a rigid motion. The search evaluates a grid of rotations on a coarse cube map, whose cells are as far apart as
 * the rotations of the grid, and then refines the best few by a shrinking local search on a fine one. Both run on all
 * threads; what is kept is decided in the order of the grid.
 */
#include <math.h>
#include <string.h>

#include "align/rotate/correlate.h"
#include "align/rotate/procrustes.h"
#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/clones.h"
#include "numeric/quaternion.h"
#include "numeric/vec3.h"

/* Chosen by trial. */
enum {
  SIDE = 12,       /* cells along an edge of the cube map: 7.5° each, */
  COARSE_SIDE = 6, /* and of the one on which the grid is evaluated: 15°, as the rotations of the grid */
  CELLS = 6 * SIDE * SIDE,
  NORMAL = 4, /* where the normal of a cell begins, behind its position */
  FIELD = 8,  /* numbers of a cell: position and normal, each filled up with 0 to a vector */
  AXES = 200, /* poles of the grid of rotations, about 14° apart */
  SPINS = 24, /* rotations around each pole: 15° apart */
  GRID = AXES * SPINS,
  STARTS = 12,    /* grid points that are refined, of each list */
  GRID_GRAIN = 96 /* rotations of one task */
};
static const double APART = 0.8;   /* radians: rotations this far apart are different candidates */
static const double NORMALS = 0.3; /* variance of the normals where that of the positions is 1 */
static const double FIRST_STEP = 0.12, LAST_STEP = 0.002; /* radians of the pattern search */
static const double LEAST_CUBE =
    1e-9;           /* added to the cubed distance of a chord from the centre, by which areas are divided */
enum { MOVES = 8 }; /* most rounds of it with one step */
static const double UPRIGHT = 0.15; /* relative: an upright rotation may score this much less than the best */
static const double GOLDEN_ANGLE = 2.399963229728653; /* π (3 − √5): between neighbours of a Fibonacci lattice */

/* Mean position (centred, unit variance) and normal (variance NORMALS) of each cell of the cube map. */
typedef struct field {
  int side; /* cells along an edge: at most SIDE */
  double direction[3][CELLS], weight[CELLS], value[CELLS][FIELD];
} field;

static int32_t cell_count(const field *f) {
  return 6 * f->side * f->side;
}

static int32_t cell_of(int side, const double p[3]) {
  double x = fabs(p[0]), y = fabs(p[1]), z = fabs(p[2]);
  int axis = x >= y ? (x >= z ? 0 : 2) : (y >= z ? 1 : 2);
  double m = fabs(p[axis]), inverse = m > 0 ? 1 / m : 0;
  double u = p[(axis + 1) % 3] * inverse, v = p[(axis + 2) % 3] * inverse;
  int i = (int)((u + 1) * 0.5 * side), j = (int)((v + 1) * 0.5 * side);
  i = i < 0 ? 0 : i >= side ? side - 1 : i;
  j = j < 0 ? 0 : j >= side ? side - 1 : j;
  return ((2 * axis + (p[axis] < 0)) * side + i) * side + j;
}

static void cell_direction(int side, int32_t cell, double out[3]) {
  int j = cell % side, i = cell / side % side, face = cell / (side * side), axis = face / 2;
  out[axis] = face % 2 ? -1 : 1;
  out[(axis + 1) % 3] = (2 * i + 1.0) / side - 1;
  out[(axis + 2) % 3] = (2 * j + 1.0) / side - 1;
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
  int n = 1 + (int)(sqrt(longest) * 2 * f->side);
  double area = orb_det(p[0], p[1], p[2]) / (n * n);
  for (int i = 0; i < n; i++) {
    for (int j = 0; j < 2 * (n - i) - 1; j++) {
      double a = (i + (j % 2 ? 2.0 : 1.0) / 3) / n, b = (j / 2 + (j % 2 ? 2.0 : 1.0) / 3) / n, c = 1 - a - b, q[3];
      for (int k = 0; k < 3; k++) {
        q[k] = c * p[0][k] + a * p[1][k] + b * p[2][k];
      }
      double r2 = orb_dot(q, q), density = area / (r2 * sqrt(r2) + LEAST_CUBE);
      int32_t cell = cell_of(f->side, q);
      f->weight[cell] += density;
      for (int k = 0; k < 3; k++) {
        f->value[cell][k] += density * (c * x[0][k] + a * x[1][k] + b * x[2][k]);
        f->value[cell][NORMAL + k] += density * normal[k];
      }
    }
  }
}

static void field_make(field *f, int side, const orb_aligned_shape *shape) {
  memset(f, 0, sizeof *f);
  f->side = side;
  for (int32_t t = 0; t < shape->mesh.triangle_count; t++) {
    splat(f, shape, t);
  }
  double mean[3] = {0, 0, 0}, variance = 0, normal_variance = 0, total = 0;
  for (int32_t c = 0; c < cell_count(f); c++) {
    double direction[3];
    cell_direction(side, c, direction);
    for (int k = 0; k < 3; k++) {
      f->direction[k][c] = direction[k];
    }
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
  for (int32_t c = 0; c < cell_count(f); c++) {
    for (int k = 0; k < 3; k++) {
      f->value[c][k] -= mean[k] / total;
      variance += f->weight[c] * f->value[c][k] * f->value[c][k];
      normal_variance += f->weight[c] * f->value[c][NORMAL + k] * f->value[c][NORMAL + k];
    }
  }
  double scale = sqrt(total / (variance + ORB_TINY)),
         scale_normal = sqrt(NORMALS * total / (normal_variance + ORB_TINY));
  for (int32_t c = 0; c < cell_count(f); c++) {
    f->weight[c] /= total;
    for (int k = 0; k < 3; k++) {
      f->value[c][k] *= f->weight[c] > 0 ? scale : 0;
      f->value[c][NORMAL + k] *= f->weight[c] > 0 ? scale_normal : 0;
    }
  }
}

typedef struct start {
  double q[4], score;
} start;

/* Grid points of the highest scores: without a rotation in space, and with the best one. */
typedef struct starts {
  start upright[STARTS], best[STARTS];
} starts;

typedef struct search {
  orb_context *ctx;
  field fine[2], coarse[2]; /* of both shapes */
  const double *from, *to;  /* landmarks that should meet */
  int32_t marks;
  double upright[GRID], best[GRID];         /* scores of the grid */
  starts kept;                              /* the highest ones; those that are refined */
  orb_status status[GRID / GRID_GRAIN + 1]; /* of each task */
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

/* cell_of() of all cells, whose directions a rotation of b moves; what R carries to d lies at Rᵀ d. */
ORB_CLONES static void rotate_cells(const field *a, int side, const double r[9], int32_t *restrict out) {
  const int count = 6 * a->side * a->side;
  const double *restrict dx = a->direction[0], *restrict dy = a->direction[1], *restrict dz = a->direction[2];
  for (int c = 0; c < count; c++) {
    const double x = r[0] * dx[c] + r[3] * dy[c] + r[6] * dz[c], y = r[1] * dx[c] + r[4] * dy[c] + r[7] * dz[c],
                 z = r[2] * dx[c] + r[5] * dy[c] + r[8] * dz[c];
    const int by_x = (fabs(x) >= fabs(y)) & (fabs(x) >= fabs(z)), by_y = !by_x & (fabs(y) >= fabs(z));
    const double major = by_x ? x : by_y ? y : z, u = by_x ? y : by_y ? z : x, v = by_x ? z : by_y ? x : y;
    const double inverse = 1 / fabs(major); /* directions have length 1 */
    int i = (int)((u * inverse + 1) * 0.5 * side), j = (int)((v * inverse + 1) * 0.5 * side);
    i = i < 0 ? 0 : i < side ? i : side - 1;
    j = j < 0 ? 0 : j < side ? j : side - 1;
    out[c] = ((2 * (by_x ? 0 : by_y ? 1 : 2) + (major < 0)) * side + i) * side + j;
  }
}

/* Adds up the cross-covariance of the cells of a with those of b beside them. */
ORB_CLONES static void covary(const field *a, const field *b, const int32_t *cell, double m[3][NORMAL]) {
  const int count = 6 * a->side * a->side;
  double sum[3][NORMAL] = {{0}};
  for (int c = 0; c < count; c++) {
    const double *restrict fa = a->value[c], *restrict fb = b->value[cell[c]], w = a->weight[c];
    for (int i = 0; i < 3; i++) {
      for (int j = 0; j < NORMAL; j++) {
        sum[i][j] += w * (fb[i] * fa[j] + fb[NORMAL + i] * fa[NORMAL + j]);
      }
    }
  }
  memcpy(m, sum, sizeof sum);
}

/* Correlation of a with b rotated on the sphere: *upright without, *best with the best rotation in space. */
static orb_status score_of(const search *s, const field of[2], const double r[9], double *upright, double *best) {
  int32_t cell[CELLS];
  double sum[3][NORMAL], m[9];
  rotate_cells(&of[0], of[1].side, r, cell);
  covary(&of[0], &of[1], cell, sum);
  for (int k = 0; k < 9; k++) {
    m[k] = sum[k / 3][k % 3];
  }
  double in_space[9], singular[3];
  ORB_TRY(orb_procrustes_covariance(s->ctx, m, in_space, singular));
  double lost = misfit(s, r);
  *upright = (m[0] + m[4] + m[8]) / (1 + NORMALS) - lost;
  *best = (singular[0] + singular[1] + singular[2]) / (1 + NORMALS) - lost;
  return ORB_OK;
}

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

/* Point i of a grid over SO(3): a Fibonacci lattice of poles, and rotations around each. */
static void grid_point(int32_t i, double q[4]) {
  int pole = i / SPINS, j = i % SPINS;
  double z = 1 - (2 * pole + 1.0) / AXES, angle = pole * GOLDEN_ANGLE;
  double half = sqrt((1 + z) / 2), other = sqrt((1 - z) / 2);
  double tilt[4] = {half, -other * sin(angle), other * cos(angle), 0};
  double spin[4] = {cos(M_PI * j / SPINS), 0, 0, sin(M_PI * j / SPINS)};
  orb_quaternion_product(tilt, spin, q);
}

static void score_grid(void *arg, int64_t begin, int64_t end, int thread) {
  search *s = arg;
  orb_status *status = &s->status[begin / GRID_GRAIN];
  (void)thread;
  *status = ORB_OK;
  for (int64_t i = begin; i < end && *status == ORB_OK; i++) {
    double q[4], r[9];
    grid_point((int32_t)i, q);
    orb_quaternion_rotation(q, r);
    *status = score_of(s, s->coarse, r, &s->upright[i], &s->best[i]);
  }
}

/* Evaluates the grid. */
static orb_status coarse(search *s) {
  orb_parallel_for(s->ctx, GRID, GRID_GRAIN, score_grid, s);
  for (int i = 0; i < GRID / GRID_GRAIN; i++) {
    ORB_TRY(s->status[i]);
  }
  return orb_context_check(s->ctx);
}

/* Pattern search: small rotations around the three axes in both directions, halved until they are tiny. */
static orb_status descend(const search *s, start *from, int use_upright) {
  double r[9], up, any;
  orb_quaternion_rotation(from->q, r);
  ORB_TRY(score_of(s, s->fine, r, &up, &any));
  from->score = use_upright ? up : any;
  for (double step = FIRST_STEP; step > LAST_STEP; step /= 2) {
    for (int moved = 1, rounds = 0; moved && rounds < MOVES; rounds++) {
      moved = 0;
      for (int k = 0; k < 6; k++) {
        double spin[4] = {cos(step / 2), 0, 0, 0}, q[4];
        spin[1 + k / 2] = k % 2 ? -sin(step / 2) : sin(step / 2);
        orb_quaternion_product(spin, from->q, q);
        orb_quaternion_rotation(q, r);
        ORB_TRY(score_of(s, s->fine, r, &up, &any));
        if ((use_upright ? up : any) > from->score) {
          from->score = use_upright ? up : any;
          memcpy(from->q, q, sizeof q);
          moved = 1;
        }
      }
    }
  }
  return ORB_OK;
}

static void descend_range(void *arg, int64_t begin, int64_t end, int thread) {
  search *s = arg;
  (void)thread;
  for (int64_t i = begin; i < end; i++) {
    start *one = i < STARTS ? &s->kept.upright[i] : &s->kept.best[i - STARTS];
    s->status[i] = one->score > -INFINITY ? descend(s, one, i < STARTS) : ORB_OK;
  }
}

/* Keeps the highest points of the grid and refines them. spaced: keeps starts that are far from each other. */
static orb_status refine(search *s, int spaced) {
  for (int i = 0; i < STARTS; i++) {
    s->kept.upright[i].score = s->kept.best[i].score = -INFINITY;
  }
  for (int32_t i = 0; i < GRID; i++) {
    double q[4];
    grid_point(i, q);
    keep_start(s->kept.upright, q, s->upright[i], spaced);
    keep_start(s->kept.best, q, s->best[i], spaced);
  }
  orb_parallel_for(s->ctx, 2 * STARTS, 1, descend_range, s);
  for (int i = 0; i < 2 * STARTS; i++) {
    ORB_TRY(s->status[i]);
  }
  return orb_context_check(s->ctx);
}

/* A search whose grid is evaluated. */
static orb_status search_create(orb_context *ctx, const orb_aligned_shape *a, const orb_aligned_shape *b,
                                const double *from, const double *to, int32_t count, search **out) {
  search *s = *out = ORB_NEW0(ctx, search, 1);
  if (!s) {
    return ORB_E_NO_MEMORY;
  }
  s->ctx = ctx;
  s->from = from;
  s->to = to;
  s->marks = count;
  for (int k = 0; k < 2; k++) {
    field_make(&s->fine[k], SIDE, k ? b : a);
    field_make(&s->coarse[k], COARSE_SIDE, k ? b : a);
  }
  return coarse(s);
}

/* The best rotation for shapes in one upright frame, unless another explains much more. */
static const start *choose(const starts *list) {
  const start *top_upright = list->upright, *top_best = list->best;
  for (int i = 1; i < STARTS; i++) {
    top_upright = list->upright[i].score > top_upright->score ? &list->upright[i] : top_upright;
    top_best = list->best[i].score > top_best->score ? &list->best[i] : top_best;
  }
  return top_upright->score > top_best->score - UPRIGHT * fabs(top_best->score) ? top_upright : top_best;
}

orb_status orb_rotation_search_near(orb_context *ctx, const orb_aligned_shape *a, const orb_aligned_shape *b,
                                    const double *from, const double *to, int32_t count, double rotation[9],
                                    double *score) {
  search *s = NULL;
  orb_status status;
  ORB_GO(status, search_create(ctx, a, b, from, to, count, &s), end);
  ORB_GO(status, refine(s, 0), end);
  const start *chosen = choose(&s->kept);
  orb_quaternion_rotation(chosen->q, rotation);
  if (score) {
    *score = chosen->score;
  }
end:
  orb_free(ctx, s);
  return status;
}

/* The highest start of both lists that is far from all that are taken; NULL: none. */
static const start *next_start(const starts *list, const start *taken, int32_t count) {
  const start *top = NULL;
  for (int i = 0; i < 2 * STARTS; i++) {
    const start *one = i < STARTS ? &list->upright[i] : &list->best[i - STARTS];
    int known = 0;
    for (int32_t k = 0; k < count; k++) {
      known |= is_near(one->q, taken[k].q);
    }
    top = !known && one->score > -INFINITY && (!top || one->score > top->score) ? one : top;
  }
  return top;
}

orb_status orb_rotation_candidates(orb_context *ctx, const orb_aligned_shape *a, const orb_aligned_shape *b,
                                   int32_t most, double *rotations, int32_t *count) {
  search *s = NULL;
  start taken[2 * STARTS];
  orb_status status;
  *count = 0;
  ORB_GO(status, search_create(ctx, a, b, NULL, NULL, 0, &s), end);
  ORB_GO(status, refine(s, 0), end);
  taken[0] = *choose(&s->kept);
  ORB_GO(status, refine(s, 1), end);
  for (const start *top = taken; top && *count < most && *count < 2 * STARTS;) {
    taken[*count] = *top;
    orb_quaternion_rotation(top->q, rotations + 9 * (*count)++);
    top = next_start(&s->kept, taken, *count);
  }
end:
  orb_free(ctx, s);
  return status;
}

orb_status orb_rotation_search(orb_context *ctx, const orb_aligned_shape *a, const orb_aligned_shape *b,
                               double rotation[9], double *score) {
  return orb_rotation_search_near(ctx, a, b, NULL, NULL, 0, rotation, score);
}
