/* The stars of several vertices, one vertex in each lane. The energy and the notation are those of star.c; what differs
 * is that quotients share divisions, for which the loop would otherwise wait. */
#include "align/map/engine/vector/jobs.h"

/* Keeps a quotient finite where the divisor vanishes; far below every length and area that occurs. */
static const double TINY = 1e-150;

/* Triangle i of every star. A lane whose star has fewer triangles gets triangles without any side and without
 * cotangents there: they add exact zeros to the energy and its derivatives. */
typedef struct step_triangle {
  vd q[3];             /* position of neighbour i; the next triangle has the third corner's */
  vd grow[3];          /* signed area = ½ grow·(y − q) */
  vd plane[3], det;    /* on the sphere: determinant = plane·x, and its value */
  vd hinge;            /* inverse of where the barrier begins */
  vd far2;             /* |r − q|² */
  vd epsilon;          /* of the regularised area */
  vd cv, cq, cr, area; /* cotangents at the vertex, q and r */
  vm live;             /* lanes whose star has the triangle */
} step_triangle;

/* A vertex in each lane. */
typedef struct step_corner {
  vd y[3], x[3], n[3], density; /* position, point on the sphere, normal; of the fixed shape there */
} step_corner;

/* Energy and its derivatives along the tangents. */
typedef struct step_system {
  vd energy, g[2], h[3];
} step_system;

typedef struct step_batch {
  int32_t v[ORB_LANES];
  int count;                                /* lanes in use; those after them repeat the vertex of the first */
  int32_t valence;                          /* the largest */
  int32_t first[ORB_LANES], end[ORB_LANES]; /* spokes of each vertex, */
  vm spokes;                                /* and how many */
  step_corner centre;
  vd e1[3], e2[3];    /* tangents at its place */
  vd target[3], pull; /* spatial target and the strength of its pull */
  step_system system;
  vd longest2; /* square of the longest side of the one-ring */
  vm hinged;   /* lanes where some determinant is below where the barrier begins */
  step_triangle triangle[ORB_MAP_STEP_RING_MAX + 1];
} step_batch;

static inline vd dot3(const vd a[3], const vd b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void sub3(const vd a[3], const vd b[3], vd out[3]) {
  for (int k = 0; k < 3; k++) {
    out[k] = a[k] - b[k];
  }
}

static inline void cross3(const vd a[3], const vd b[3], vd out[3]) {
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Lane l gets the vertex whose row is row[l]. */
static inline void corner_load(const double *row[ORB_LANES], step_corner *out) {
  vd part[3][4];
  for (int i = 0; i < 3; i++) {
    vd_rows4(row, part[i]);
    for (int l = 0; l < LANES; l++) {
      row[l] += 4;
    }
  }
  memcpy(out->y, part[0], sizeof out->y);
  out->x[0] = part[0][3];
  out->x[1] = part[1][0];
  out->x[2] = part[1][1];
  out->n[0] = part[1][2];
  out->n[1] = part[1][3];
  out->n[2] = part[2][0];
  out->density = part[2][1];
}

/* Reads the vertices list[begin] to list[end − 1] with their places. */
static inline void batch_load(const orb_map_step_job *job, int64_t begin, int64_t end, step_batch *b) {
  const double *row[ORB_LANES], *tangent[ORB_LANES];
  b->count = (int)(end - begin);
  b->valence = 0;
  for (int l = 0; l < LANES; l++) {
    int32_t v = job->list[l < b->count ? begin + l : begin];
    b->v[l] = v;
    b->first[l] = job->level->start[v];
    b->end[l] = job->level->start[v + 1];
    int32_t spokes = b->end[l] - b->first[l];
    b->spokes[l] = spokes;
    b->valence = spokes > b->valence ? spokes : b->valence;
    row[l] = job->row + ORB_MAP_ROW * (int64_t)v;
    tangent[l] = job->fixed->triangle_row + ORB_MAP_ROW * (int64_t)job->triangle[v] + 4;
  }
  corner_load(row, &b->centre);
  vd e[8];
  vd_rows4(tangent, e);
  for (int l = 0; l < LANES; l++) {
    tangent[l] += 4;
  }
  vd_rows4(tangent, e + 4);
  memcpy(b->e1, e, sizeof b->e1);
  memcpy(b->e2, e + 3, sizeof b->e2);
}

/* Neighbour i of every vertex. After the last comes the first, which closes the ring, again and again. */
static inline void ring_load(const orb_map_step_job *job, const step_batch *b, int32_t i, step_corner *out) {
  const double *row[ORB_LANES];
  for (int l = 0; l < LANES; l++) {
    int32_t e = b->first[l] + i;
    row[l] = job->row + ORB_MAP_ROW * (int64_t)job->ring[e < b->end[l] ? e : b->first[l]];
  }
  corner_load(row, out);
}

/* The metric of triangle i of every star. */
static inline void spoke_load(const orb_map_step_job *job, const step_batch *b, int32_t i, step_triangle *t) {
  static const float NONE[4] = {0, 0, 0, 1};
  const float *spoke[ORB_LANES];
  vd shape[4];
  for (int l = 0; l < LANES; l++) {
    int32_t e = b->first[l] + i;
    spoke[l] = e < b->end[l] ? job->spoke + 4 * (int64_t)e : NONE;
  }
  vd_float_rows4(spoke, shape);
  t->cv = shape[0];
  t->cq = shape[1];
  t->cr = shape[2];
  t->area = shape[3];
  t->live = (vm)(i < b->spokes);
}

/* r − 1 − ln r below 1, with its derivatives; soft: continued by a parabola, which is finite. */
static inline double barrier(const orb_map_step_job *job, double r, double *first, double *second) {
  const orb_map_params *params = job->level->params;
  const double r0 = params->star.soft_below;
  if (!job->rules->soft || r >= r0) {
    *first = 1 - 1 / r;
    *second = 1 / (r * r);
    return r - 1 - log(r);
  }
  double d = r - r0;
  *second = 1 / (r0 * r0);
  *first = 1 - 1 / r0 + d * *second;
  return params->star.soft_value + (1 - 1 / r0) * d + 0.5 * d * d * *second;
}

/* What the positive part of an area needs: 1/χ(s) and 1/√(s² + ε²). χ(s)·χ(−s) = ε²/4, so χ of a negative s is a
 * quotient without cancellation. */
static inline void positive_part(vd s, vd epsilon, vd *inverse, vd *root_inverse) {
  vd root = vd_sqrt(s * s + epsilon * epsilon), larger = 0.5 * (vd_max(s, -s) + root), one = vd_set(1);
  vm upright = (vm)(s >= 0.0);
  vd divisor = vd_choose(upright, larger, 0.25 * epsilon * epsilon + TINY), both = 1.0 / (divisor * root);
  *inverse = vd_choose(upright, one, larger) * root * both;
  *root_inverse = divisor * both;
}

/* Energy of triangle t with the vertices at y, without the barrier. next: the position of its third corner. */
static inline vd triangle_energy(const step_triangle *t, const vd next[3], const vd y[3]) {
  vd u[3], z[3], inverse, unused;
  sub3(y, t->q, u);
  sub3(y, next, z);
  vd d = 0.5 * (t->cv * t->far2 + t->cq * dot3(z, z) + t->cr * dot3(u, u));
  positive_part(0.5 * dot3(t->grow, u), t->epsilon, &inverse, &unused);
  vd h = t->area * inverse;
  return d * (1.0 + h * h);
}

/* Few lanes have a barrier. */
static inline void add_barriers(const orb_map_step_job *job, const step_triangle *t, vd r, vm low, vd *energy) {
  for (int l = 0; l < LANES; l++) {
    double first, second;
    if (low[l]) {
      (*energy)[l] += job->rules->barrier * t->area[l] * barrier(job, r[l], &first, &second);
    }
  }
}

/* Energy with the vertices at y, on the sphere at x; infinite where flips are not allowed and a determinant falls to
 * params.step.shrink times its value or less. */
static inline vd batch_energy(const orb_map_step_job *job, const step_batch *b, const vd y[3], const vd x[3]) {
  vd energy = vd_set(0), distance[3];
  vm folded = {0};
  const double shrink = job->level->params->step.shrink;
  for (int32_t i = 0; i < b->valence; i++) {
    const step_triangle *t = &b->triangle[i];
    vd det = dot3(t->plane, x), r = det * t->hinge;
    if (!job->rules->soft) {
      folded |= ~(vm)(det > shrink * t->det) & t->live;
    }
    energy += triangle_energy(t, t[1].q, y);
    vm low = (vm)(r < 1.0) & t->live & ~folded;
    if (vm_any(low)) {
      add_barriers(job, t, r, low, &energy);
    }
  }
  if (job->pulled) {
    sub3(y, b->target, distance);
    energy += b->pull * dot3(distance, distance);
  }
  return vd_choose(folded, vd_set(INFINITY), energy);
}
