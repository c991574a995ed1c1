/* Gradient and Hessian of the stars of a batch, and the Newton direction. */
#include "align/map/engine/vector/batch.inc.h"

/* The direction in which the signed area of a triangle grows, along the fixed shape's normals, or along the triangle's
 * own where those cancel; and where the barrier of its determinant begins. */
static inline void orient(const orb_map_step_job *job, const step_batch *b, const step_corner *q, const step_corner *r,
                          step_triangle *t) {
  const orb_map_params *params = job->level->params;
  vd side[3], u[3], normal[3];
  sub3(r->y, q->y, side);
  for (int k = 0; k < 3; k++) {
    normal[k] = b->centre.n[k] + q->n[k] + r->n[k];
  }
  vd length = vd_sqrt(dot3(normal, normal));
  vm low = (vm)(length < params->star.upright) & t->live;
  if (vm_any(low)) {
    vd own[3];
    sub3(b->centre.y, q->y, u);
    cross3(side, u, own);
    length = vd_choose(low, vd_sqrt(dot3(own, own)), length);
    for (int k = 0; k < 3; k++) {
      normal[k] = vd_choose(low, own[k], normal[k]);
    }
  }
  vd density = vd_min(b->centre.density, vd_min(q->density, r->density));
  vd begins = params->star.hinge * 2.0 * t->area * density + TINY;
  length += TINY;
  vd both = 1.0 / (length * begins), inverse = begins * both;
  t->hinge = length * both;
  cross3(normal, side, t->grow);
  for (int k = 0; k < 3; k++) {
    t->grow[k] *= inverse;
  }
  t->far2 = dot3(side, side);
}

/* The determinant on the sphere. */
static inline void span(step_batch *b, const step_corner *q, const step_corner *r, step_triangle *t) {
  vd edge[3];
  sub3(r->x, q->x, edge);
  cross3(q->x, edge, t->plane);
  t->det = dot3(t->plane, b->centre.x);
  b->hinged |= (vm)(t->det * t->hinge < 1.0) & t->live;
}

/* Adds the share of a triangle, without the barrier. */
static inline void add_triangle(const orb_map_step_job *job, const step_batch *b, const step_corner *r,
                                step_triangle *t, step_system *sum) {
  vd u[3], z[3], inverse, root_inverse, cq = t->cq, cr = t->cr, area = t->area;
  sub3(b->centre.y, t->q, u);
  sub3(b->centre.y, r->y, z);
  vd d = 0.5 * (t->cv * t->far2 + cq * dot3(z, z) + cr * dot3(u, u)), dd = cq + cr;
  vd d1 = cq * dot3(z, b->e1) + cr * dot3(u, b->e1), d2 = cq * dot3(z, b->e2) + cr * dot3(u, b->e2);
  vd s = 0.5 * dot3(t->grow, u), s1 = 0.5 * dot3(t->grow, b->e1), s2 = 0.5 * dot3(t->grow, b->e2);
  vd e = job->rules->epsilon * (vd_min(0.5 * d, area) + job->level->params->star.flat * area);
  positive_part(s, e, &inverse, &root_inverse);
  vd h = area * inverse;
  h *= h;
  /* With f = 1 + (a/χ)²: χ' = χ/√(s² + ε²) and χ'' = ½ ε²/√(s² + ε²)³, so χ cancels from f'. */
  vd f = 1.0 + h, fp = -2.0 * h * root_inverse, second = 0.5 * e * e * root_inverse * inverse;
  vd fpp = vd_max(2.0 * h * root_inverse * root_inverse * (3.0 - second), vd_set(0));
  t->epsilon = e;
  sum->energy += d * f;
  sum->g[0] += f * d1 + d * fp * s1;
  sum->g[1] += f * d2 + d * fp * s2;
  sum->h[0] += f * dd + 2.0 * fp * d1 * s1 + d * fpp * s1 * s1;
  sum->h[1] += fp * (d1 * s2 + d2 * s1) + d * fpp * s1 * s2;
  sum->h[2] += f * dd + 2.0 * fp * d2 * s2 + d * fpp * s2 * s2;
}

static inline void add_triangles(const orb_map_step_job *job, step_batch *b) {
  step_corner q, r;
  step_system sum = {0}; /* in registers: stars are short */
  b->longest2 = vd_set(0);
  b->hinged = (vm){0};
  ring_load(job, b, 0, &q);
  for (int32_t i = 0; i < b->valence; i++) {
    step_triangle *t = &b->triangle[i];
    spoke_load(job, b, i, t);
    ring_load(job, b, i + 1, &r);
    memcpy(t->q, q.y, sizeof t->q);
    orient(job, b, &q, &r, t);
    span(b, &q, &r, t);
    add_triangle(job, b, &r, t, &sum);
    b->longest2 = vd_max(b->longest2, t->far2);
    q = r;
  }
  b->system = sum;
  memcpy(b->triangle[b->valence].q, q.y, sizeof q.y);
}

/* Derivatives of lane l's point on the sphere along the tangents of its place. */
static inline void sphere_jacobian(const orb_map_step_job *job, const step_batch *b, int l, double j[2][3]) {
  const orb_map_packed *fixed = job->fixed;
  const int32_t t = job->triangle[b->v[l]], *corner = fixed->triangles + 3 * (int64_t)t;
  const double *rate = fixed->triangle_row + ORB_MAP_ROW * (int64_t)t, *at = job->at + 3 * (int64_t)b->v[l];
  const double *s[3];
  double size2 = 0, along[2] = {0, 0};
  for (int c = 0; c < 3; c++) {
    s[c] = fixed->vertex_row + ORB_MAP_ROW * (int64_t)corner[c] + 3;
  }
  for (int k = 0; k < 3; k++) {
    double x = at[0] * s[0][k] + at[1] * s[1][k] + at[2] * s[2][k];
    size2 += x * x;
  }
  if (isnan(rate[0])) {
    memset(j, 0, sizeof(double[2][3]));
    return;
  }
  double scale = 1 / (sqrt(size2) + TINY);
  for (int i = 0; i < 2; i++) {
    for (int k = 0; k < 3; k++) {
      j[i][k] = ((s[1][k] - s[0][k]) * rate[i] + (s[2][k] - s[0][k]) * rate[2 + i]) * scale;
      along[i] += j[i][k] * b->centre.x[k][l];
    }
    for (int k = 0; k < 3; k++) {
      j[i][k] -= along[i] * b->centre.x[k][l];
    }
  }
}

/* Adds the barriers of one lane. */
static void add_hinges(const orb_map_step_job *job, step_batch *b, int l) {
  double j[2][3];
  sphere_jacobian(job, b, l, j);
  for (int32_t i = 0; i < b->end[l] - b->first[l]; i++) {
    const step_triangle *t = &b->triangle[i];
    double hinge = t->hinge[l], r = t->det[l] * hinge, first, second, g[2] = {0, 0};
    if (r >= 1) {
      continue;
    }
    double q = job->rules->barrier * t->area[l];
    b->system.energy[l] += q * barrier(job, r, &first, &second);
    for (int k = 0; k < 3; k++) {
      g[0] += t->plane[k][l] * j[0][k] * hinge;
      g[1] += t->plane[k][l] * j[1][k] * hinge;
    }
    b->system.g[0][l] += q * first * g[0];
    b->system.g[1][l] += q * first * g[1];
    b->system.h[0][l] += q * second * g[0] * g[0];
    b->system.h[1][l] += q * second * g[0] * g[1];
    b->system.h[2][l] += q * second * g[1] * g[1];
  }
}

static inline void add_pull(const orb_map_step_job *job, step_batch *b) {
  vd d[3];
  for (int l = 0; l < LANES; l++) {
    b->pull[l] = job->level->pull[b->v[l]];
    for (int k = 0; k < 3; k++) {
      b->target[k][l] = b->pull[l] > 0 ? job->level->target[3 * (int64_t)b->v[l] + k] : 0;
    }
  }
  sub3(b->centre.y, b->target, d);
  b->system.energy += b->pull * dot3(d, d);
  b->system.g[0] += 2.0 * b->pull * dot3(d, b->e1);
  b->system.g[1] += 2.0 * b->pull * dot3(d, b->e2);
  b->system.h[0] += 2.0 * b->pull;
  b->system.h[2] += 2.0 * b->pull;
}

/* Energy, gradient and Hessian of every star. */
static inline void batch_expand(const orb_map_step_job *job, step_batch *b) {
  add_triangles(job, b);
  for (int l = 0; l < b->count && vm_any(b->hinged); l++) {
    if (b->hinged[l]) {
      add_hinges(job, b, l);
    }
  }
  if (job->pulled) {
    add_pull(job, b);
  }
}

/* The Newton direction, with the Hessian made positive definite. Returns the lanes where it descends enough to be
 * tried. */
static inline vm batch_solve(const orb_map_step_job *job, const step_batch *b, vd step[2], vd *slope) {
  const orb_map_params *params = job->level->params;
  vd mean = 0.5 * (b->system.h[0] + b->system.h[2]), gap = 0.5 * (b->system.h[0] - b->system.h[2]);
  vd root = vd_sqrt(gap * gap + b->system.h[1] * b->system.h[1]), low = mean - root, high = mean + root;
  vd largest = vd_max(vd_max(high, -high), vd_max(low, -low));
  vd shift = vd_max(params->step.convexity * largest - low, vd_set(0));
  vd h0 = b->system.h[0] + shift, h1 = b->system.h[1], h2 = b->system.h[2] + shift, inverse = 1.0 / (h0 * h2 - h1 * h1);
  step[0] = (h1 * b->system.g[1] - h2 * b->system.g[0]) * inverse;
  step[1] = (h1 * b->system.g[0] - h0 * b->system.g[1]) * inverse;
  *slope = b->system.g[0] * step[0] + b->system.g[1] * step[1];
  vd least = params->step.least_slope * vd_max(b->system.energy, -b->system.energy);
  return (vm)(*slope < 0.0) & (vm)(-*slope >= least);
}
