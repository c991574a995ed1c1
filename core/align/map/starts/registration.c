/* Spatial targets of a composed map, by non-rigid registration in space.
 *
 * A spline (kernel |r|; Duchon 1977) moves the moving shape away from a similarity. It starts through the anchors, from
 * their similarity; with fewer than four anchors, from the best of 24 rigid registrations (Besl & McKay 1992). Rounds
 * of iterative closest points refine it: controls spread over the moving shape look for the vertex of the fixed shape
 * that is nearest in position and half-weighted normal, with more controls and less stiffness from round to round.
 * Anchors keep their targets throughout. Lengths are those of shapes scaled to area 4π.
 */
#include <math.h>
#include <string.h>

#include "align/map/engine/spread.h"
#include "align/map/starts/registration.h"
#include "base/check.h"
#include "base/error.h"
#include "base/loops.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/clones.h"
#include "numeric/dense.h"
#include "numeric/rotation.h"
#include "numeric/vec3.h"

enum {
  SLICE = 8192, /* vertices between checks for cancellation */
  BLOCK = 256   /* vertices of the fixed shape that are measured at once */
};

typedef struct spline {
  int32_t count;
  double *centre; /* 3 each */
  double *weight; /* 3 each, then 12 of the affine part: constant, x, y, z, each of 3 */
} spline;

typedef struct targets_run {
  orb_context *ctx;
  const orb_map_params *params;
  const orb_map_surface *b;
  const double *x, *normal;
  int32_t vertex_count;
  const orb_map_anchors *anchors;
  float *searched;  /* of the fixed shape's vertices: positions and weighted normals, six columns of `columns` each */
  int32_t columns;  /* a multiple of BLOCK */
  int32_t stride;   /* through the fixed shape's vertices */
  int32_t *control; /* farthest points of the moving shape */
  int32_t control_count;
  double *target;   /* 3 per control */
  double *mapped;   /* 6 per control: position and normal under the spline */
  double *distance; /* of each control to its target, squared, with the normals' part; negative: faces away */
  spline s;
  double base[12]; /* the similarity that the spline departs from, laid out like its affine part */
  double *matrix;
  double *out; /* targets, 3 per vertex */
} targets_run;

/* The spline at p, and its Jacobian (row-major; NULL: not needed). */
static void spline_at(const spline *s, const double p[3], double y[3], double *jacobian) {
  const double *affine = s->weight + 3 * (size_t)s->count;
  for (int k = 0; k < 3; k++) {
    y[k] = affine[k] + p[0] * affine[3 + k] + p[1] * affine[6 + k] + p[2] * affine[9 + k];
    for (int j = 0; j < 3 && jacobian; j++) {
      jacobian[3 * k + j] = affine[3 + 3 * j + k];
    }
  }
  for (int32_t i = 0; i < s->count; i++) {
    double d[3];
    orb_sub(p, s->centre + 3 * (size_t)i, d);
    double r = orb_length(d);
    const double *w = s->weight + 3 * (size_t)i;
    for (int k = 0; k < 3; k++) {
      y[k] -= r * w[k];
      for (int j = 0; j < 3 && jacobian && r > 0; j++) {
        jacobian[3 * k + j] -= w[k] * d[j] / r;
      }
    }
  }
}

/* A normal under the Jacobian: by its cofactors. */
static void map_normal(const double j[9], const double n[3], double out[3]) {
  double c[9];
  (void)orb_cofactors(j, c);
  for (int k = 0; k < 3; k++) {
    out[k] = orb_dot(c + 3 * k, n);
  }
  orb_normalize(out);
}

/* Fits the spline to `count` centres (first the anchors) and targets, with stiffness on the diagonal. Its affine part
 * is the base plus a shift: anchors on one side of the shape would carry a free affine part far off. */
static orb_status spline_fit(targets_run *run, int32_t count, double stiffness) {
  const orb_map_params *params = run->params;
  spline *s = &run->s;
  size_t n = (size_t)count + 1;
  memset(run->matrix, 0, n * n * sizeof *run->matrix);
  for (int32_t i = 0; i < count; i++) {
    const double *p = s->centre + 3 * (size_t)i;
    for (int32_t j = 0; j < count; j++) {
      run->matrix[(size_t)i * n + (size_t)j] = -sqrt(orb_distance2(p, s->centre + 3 * (size_t)j));
    }
    run->matrix[(size_t)i * n + (size_t)i] += i < run->anchors->exact   ? params->registration.exact_stiffness
                                              : i < run->anchors->count ? params->registration.sample_stiffness
                                                                        : stiffness;
    run->matrix[(size_t)i * n + (size_t)count] = run->matrix[(size_t)count * n + (size_t)i] = 1;
    for (int k = 0; k < 3; k++) {
      const double *base = run->base;
      s->weight[3 * (size_t)i + (size_t)k] = run->target[3 * (size_t)i + (size_t)k] - base[k] - p[0] * base[3 + k] -
                                             p[1] * base[6 + k] - p[2] * base[9 + k];
    }
  }
  double *affine = s->weight + 3 * (size_t)count;
  memset(affine, 0, sizeof(double[3]));
  if (orb_dense_solve((int32_t)n, run->matrix, 3, s->weight) != 0) {
    return orb_fail(run->ctx, ORB_E_INTERNAL, "The spline through %d controls has no solution.", count);
  }
  for (int k = 0; k < 12; k++) {
    affine[k] = run->base[k] + (k < 3 ? affine[k] : 0);
  }
  s->count = count;
  return ORB_OK;
}

/* Squared distances in position and normal of BLOCK vertices. */
ORB_CLONES static void measure(const float *at, int32_t columns, const float q[6], float *out) {
  for (int i = 0; i < BLOCK; i++) {
    float sum = 0;
    for (int k = 0; k < 6; k++) {
      float d = at[k * (ptrdiff_t)columns + i] - q[k];
      sum += d * d;
    }
    out[i] = sum;
  }
}

/* Lays the fixed shape out for searches, with each `stride`-th of its vertices; empty columns lie at infinity. */
static orb_status lay_out(targets_run *run, int32_t stride) {
  const orb_map_surface *b = run->b;
  const float weight = (float)sqrt(run->params->registration.normal_weight);
  const int32_t count = (b->vertex_count + stride - 1) / stride;
  run->stride = stride;
  run->columns = (count + BLOCK - 1) / BLOCK * BLOCK;
  orb_free(run->ctx, run->searched);
  run->searched = ORB_NEW(run->ctx, float, 6 * (size_t)run->columns);
  if (!run->searched) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < run->columns; i++) {
    for (int k = 0; k < 6; k++) {
      size_t v = 3 * (size_t)i * (size_t)run->stride + (size_t)(k % 3);
      float x = i >= count ? INFINITY : k < 3 ? (float)b->x[v] : weight * (float)b->normal[v];
      run->searched[(size_t)k * (size_t)run->columns + (size_t)i] = x;
    }
  }
  return ORB_OK;
}

/* The vertex of the fixed shape nearest in position and normal; its score. */
static int32_t nearest_vertex(const targets_run *run, const double y[3], const double n[3], double *score) {
  const float weight = (float)sqrt(run->params->registration.normal_weight);
  const float q[6] = {(float)y[0],          (float)y[1],          (float)y[2],
                      weight * (float)n[0], weight * (float)n[1], weight * (float)n[2]};
  float least = INFINITY, block[BLOCK];
  int32_t best = 0;
  for (int32_t first = 0; first < run->columns; first += BLOCK) {
    measure(run->searched + first, run->columns, q, block);
    for (int i = 0; i < BLOCK; i++) {
      best = block[i] < least ? first + i : best;
      least = block[i] < least ? block[i] : least;
    }
  }
  *score = (double)least;
  return best * run->stride;
}

static void find_targets(void *arg, int64_t begin, int64_t end, int thread) {
  targets_run *run = arg;
  (void)thread;
  for (int64_t i = begin; i < end; i++) {
    size_t c = (size_t)i + (size_t)run->anchors->count;
    double jacobian[9], *to = run->mapped + 6 * i;
    const int32_t v = run->control[i];
    spline_at(&run->s, run->x + 3 * (size_t)v, to, jacobian);
    map_normal(jacobian, run->normal + 3 * (size_t)v, to + 3);
    int32_t hit = nearest_vertex(run, to, to + 3, &run->distance[i]);
    /* Slide in the tangent plane: nearer than the vertex, and not so far that the surface has curved away. */
    const double *p = run->b->x + 3 * (size_t)hit, *n = run->b->normal + 3 * (size_t)hit;
    double rel[3], *target = run->target + 3 * c;
    orb_sub(to, p, rel);
    double off = orb_dot(rel, n), slide = sqrt(fmax(0, orb_dot(rel, rel) - off * off)),
           most = run->params->registration.slide;
    for (int k = 0; k < 3; k++) {
      target[k] = p[k] + (rel[k] - off * n[k]) * (slide > most ? most / slide : 1);
    }
    if (orb_dot(to + 3, n) < run->params->registration.facing) {
      run->distance[i] = -1;
    }
  }
}

static void load_anchors(targets_run *run) {
  for (int32_t i = 0; i < run->anchors->count; i++) {
    memcpy(run->s.centre + 3 * (size_t)i, run->x + 3 * (size_t)run->anchors->vertex[i], 3 * sizeof(double));
    memcpy(run->target + 3 * (size_t)i, run->anchors->target + 3 * (size_t)i, 3 * sizeof(double));
  }
}

/* One round with the first `controls` controls; omits those that face away or lie far off. */
static orb_status icp_round(targets_run *run, int32_t controls, double stiffness, double *fit) {
  orb_parallel_for(run->ctx, controls, 8, find_targets, run);
  ORB_TRY(orb_context_check(run->ctx));
  const double far = run->params->registration.far;
  double sum = 0;
  int32_t facing = 0, near = 0, kept = run->anchors->count;
  for (int32_t i = 0; i < controls; i++) {
    if (run->distance[i] >= 0) {
      sum += sqrt(run->distance[i]);
      facing++;
    }
  }
  *fit = facing ? sum / facing : INFINITY;
  for (int32_t i = 0; i < controls; i++) {
    near += run->distance[i] >= 0 && sqrt(run->distance[i]) <= far * *fit;
  }
  if (near < run->params->registration.least_controls) {
    return ORB_OK; /* too few to fit: the spline stays as it is */
  }
  load_anchors(run);
  for (int32_t i = 0; i < controls; i++) {
    if (run->distance[i] >= 0 && sqrt(run->distance[i]) <= far * *fit) {
      memcpy(run->s.centre + 3 * (size_t)kept, run->x + 3 * (size_t)run->control[i], 3 * sizeof(double));
      memmove(run->target + 3 * (size_t)kept, run->target + 3 * ((size_t)i + (size_t)run->anchors->count),
              3 * sizeof(double));
      kept++;
    }
  }
  return spline_fit(run, kept, stiffness);
}

/* The i-th of the 24 rotations that map the axes to each other. */
static void axis_rotation(int i, double r[9]) {
  static const int order[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};
  const int *o = order[i / 4];
  double parity = i / 4 < 3 ? 1 : -1;
  double s0 = i & 1 ? -1 : 1, s1 = i & 2 ? -1 : 1, s2 = s0 * s1 * parity;
  memset(r, 0, 9 * sizeof *r);
  r[o[0]] = s0;
  r[3 + o[1]] = s1;
  r[6 + o[2]] = s2;
}

/* Sets the spline to y = R p + t; R may be scaled. */
static void set_rigid(spline *s, const double r[9], const double t[3]) {
  s->count = 0;
  for (int k = 0; k < 3; k++) {
    s->weight[k] = t[k];
    for (int j = 0; j < 3; j++) {
      s->weight[3 + 3 * j + k] = r[3 * k + j];
    }
  }
}

/* Fits a rigid motion to the targets of the first controls and of the anchors; an anchor weighs as much as all controls
 * together. 0: the rotation is not determined. */
static int fit_rigid(const targets_run *run, int32_t samples, double r[9], double t[3]) {
  double from[3] = {0, 0, 0}, to[3] = {0, 0, 0}, h[9] = {0}, weight_sum = 0;
  for (int pass = 0; pass < 2; pass++) {
    for (int32_t i = -run->anchors->count; i < samples; i++) {
      const double *target = run->target + 3 * ((size_t)(i + run->anchors->count));
      const double *p =
          i < 0 ? run->s.centre + 3 * (size_t)(i + run->anchors->count) : run->x + 3 * (size_t)run->control[i];
      double w = i < 0 ? (double)samples : 1;
      for (int k = 0; k < 3; k++) {
        if (pass == 0) {
          from[k] += w * p[k];
          to[k] += w * target[k];
        } else {
          for (int j = 0; j < 3; j++) {
            h[3 * k + j] += w * (target[k] - to[k]) * (p[j] - from[j]);
          }
        }
      }
      weight_sum += pass == 0 ? w : 0;
    }
    for (int k = 0; k < 3 && pass == 0; k++) {
      from[k] /= weight_sum;
      to[k] /= weight_sum;
    }
  }
  if (!orb_nearest_rotation(h, r)) {
    return 0;
  }
  for (int k = 0; k < 3; k++) {
    t[k] = to[k] - orb_dot(r + 3 * k, from);
  }
  return 1;
}

/* Rigid ICP from one rotation, over the first controls and the anchors; leaves the spline at the result. */
static orb_status rigid_icp(targets_run *run, const double start[9], double *score) {
  const orb_map_params *params = run->params;
  const double cap = params->registration.rigid_cap;
  double r[9], t[3] = {0, 0, 0};
  memcpy(r, start, sizeof r);
  int32_t most = params->registration.rigid_samples, samples = run->control_count < most ? run->control_count : most;
  for (int step = 0; step < params->registration.rigid_steps; step++) {
    set_rigid(&run->s, r, t);
    orb_parallel_for(run->ctx, samples, 8, find_targets, run);
    ORB_TRY(orb_context_check(run->ctx));
    load_anchors(run);
    if (!fit_rigid(run, samples, r, t)) {
      break;
    }
    double total = 0;
    for (int32_t i = 0; i < samples; i++) {
      total += fmin(run->distance[i] < 0 ? cap : run->distance[i], cap);
    }
    for (int32_t i = 0; i < run->anchors->count; i++) {
      double y[3];
      spline_at(&run->s, run->s.centre + 3 * (size_t)i, y, NULL);
      total += samples * fmin(orb_distance2(y, run->target + 3 * (size_t)i), cap);
    }
    *score = total;
  }
  set_rigid(&run->s, r, t);
  return ORB_OK;
}

static orb_status best_rigid(targets_run *run) {
  double best = INFINITY, keep[12];
  for (int i = 0; i < 24; i++) {
    double start[9], score = INFINITY;
    axis_rotation(i, start);
    ORB_TRY(rigid_icp(run, start, &score));
    if (score < best) {
      best = score;
      memcpy(keep, run->s.weight, sizeof keep);
    }
  }
  run->s.count = 0;
  memcpy(run->s.weight, keep, sizeof keep);
  return ORB_OK;
}

/* The similarity nearest to the anchors (Umeyama 1991). */
static void base_of_anchors(targets_run *run) {
  int32_t count = run->anchors->count;
  double from[3] = {0, 0, 0}, to[3] = {0, 0, 0}, h[9] = {0}, r[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, t[3], spread = 0,
         matched = 0;
  for (int32_t i = 0; i < 3 * count; i++) {
    from[i % 3] += run->s.centre[i] / count;
    to[i % 3] += run->target[i] / count;
  }
  for (int32_t i = 0; i < count; i++) {
    const double *p = run->s.centre + 3 * (size_t)i, *q = run->target + 3 * (size_t)i;
    for (int k = 0; k < 9; k++) {
      h[k] += (q[k / 3] - to[k / 3]) * (p[k % 3] - from[k % 3]);
    }
    spread += orb_distance2(p, from);
  }
  (void)orb_nearest_rotation(h, r);
  for (int k = 0; k < 9; k++) {
    matched += r[k] * h[k];
  }
  double scale = spread > 0 && matched > 0 ? matched / spread : 1;
  for (int k = 0; k < 9; k++) {
    r[k] *= scale;
  }
  for (int k = 0; k < 3; k++) {
    t[k] = to[k] - orb_dot(r + 3 * k, from);
  }
  set_rigid(&run->s, r, t);
  memcpy(run->base, run->s.weight, sizeof run->base);
}

static void map_range(void *arg, int64_t begin, int64_t end, int thread) {
  const targets_run *run = arg;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    spline_at(&run->s, run->x + 3 * v, run->out + 3 * v, NULL);
  }
}

static orb_status targets_compute(targets_run *run, double *out, double *fit) {
  const orb_map_params *p = run->params;
  const int32_t first = p->registration.first_controls, last = p->registration.last_controls;
  run->control_count = run->vertex_count < last ? run->vertex_count : last;
  ORB_TRY(orb_map_spread(run->ctx, run->x, run->vertex_count, run->control_count, run->control));
  if (run->anchors->count >= p->registration.least_anchors) {
    load_anchors(run);
    base_of_anchors(run);
    ORB_TRY(spline_fit(run, run->anchors->count, p->registration.exact_stiffness));
  } else {
    ORB_TRY(lay_out(run, 1 + run->b->vertex_count / p->registration.rigid_search));
    ORB_TRY(best_rigid(run));
    memcpy(run->base, run->s.weight, sizeof run->base);
  }
  ORB_TRY(lay_out(run, 1 + run->b->vertex_count / p->registration.fixed_search));
  *fit = INFINITY;
  for (int round = 0; round < p->registration.rounds; round++) {
    double f = (double)round / (p->registration.rounds - 1);
    int32_t controls = (int32_t)(first * pow((double)last / first, f));
    controls = controls < run->control_count ? controls : run->control_count;
    double fall = p->registration.last_stiffness / p->registration.first_stiffness;
    ORB_TRY(icp_round(run, controls, p->registration.first_stiffness * pow(fall, f), fit));
  }
  run->out = out;
  return orb_sliced_by(run->ctx, run->vertex_count, SLICE, 64, map_range, run);
}

orb_status orb_map_register_in_space(orb_context *ctx, const orb_map_params *params, const orb_map_surface *b,
                                     const double *x, const double *normal, int32_t vertex_count,
                                     const orb_map_anchors *anchors, double *out, double *fit) {
  size_t most = (size_t)params->registration.last_controls + (size_t)anchors->count;
  targets_run run = {
      .ctx = ctx, .params = params, .b = b, .x = x, .normal = normal, .vertex_count = vertex_count, .anchors = anchors};
  orb_status status = ORB_E_NO_MEMORY;
  run.control = ORB_NEW(ctx, int32_t, params->registration.last_controls);
  run.target = ORB_NEW(ctx, double, 3 * most);
  run.mapped = ORB_NEW(ctx, double, 6 * most);
  run.distance = ORB_NEW(ctx, double, most);
  run.s.centre = ORB_NEW(ctx, double, 3 * most);
  run.s.weight = ORB_NEW(ctx, double, 3 * most + 12);
  run.matrix = ORB_NEW(ctx, double, (most + 4) * (most + 4));
  if (run.control && run.target && run.mapped && run.distance && run.s.centre && run.s.weight && run.matrix) {
    status = targets_compute(&run, out, fit);
  }
  orb_free(ctx, run.searched);
  orb_free(ctx, run.control);
  orb_free(ctx, run.target);
  orb_free(ctx, run.mapped);
  orb_free(ctx, run.distance);
  orb_free(ctx, run.s.centre);
  orb_free(ctx, run.s.weight);
  orb_free(ctx, run.matrix);
  return status;
}
