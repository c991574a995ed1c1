#include "embed/newton/star.h"

#include <math.h>

#include "base/check.h"
#include "base/memory.h"
#include "embed/common/kernel.h"
#include "numeric/frame.h"
#include "numeric/vec3.h"

enum {
  FIELDS = 13, /* doubles of a ring entry: 3 of ring, 10 others */
  TRIES = 8    /* lengths of a step, each 0.4 of the one before */
};

/* vector/fill.inc.h and vector/sweep.inc.h have the same constants. */
static const double TINY2 = 1e-30; /* added to squared edges, at a scale of area 4π: equal points do not divide by 0 */
static const double FLAT = 1e-6;   /* least 4·area over the sum of squared edges */
static const double EIGEN_FLOOR = .05; /* least eigenvalue of the Hessian over its greatest */
static const double EDGE_SHARE = 0.8;  /* a step goes at most this share of the way to the nearest plane */

static orb_status reserve(orb_context *ctx, orb_star *star, int32_t count) {
  if (count <= star->capacity) {
    return ORB_OK;
  }
  int64_t capacity = (int64_t)count + count / 2 + 16;
  double *block = ORB_NEW(ctx, double, (FIELDS + 1) * capacity);
  if (!block) {
    return ORB_E_NO_MEMORY;
  }
  orb_free(ctx, star->block);
  star->block = block;
  star->capacity = (int32_t)capacity;
  star->ring = (double(*)[3])block;
  double **field[] = {&star->ca, &star->cb, &star->cc, &star->a2, &star->x,
                      &star->y,  &star->z,  &star->nx, &star->ny, &star->nz};
  for (int i = 0; i < FIELDS - 3; i++) {
    *field[i] = block + (3 + i) * capacity;
  }
  star->vertex = (int32_t *)(void *)(block + FIELDS * capacity);
  star->corner = star->vertex + capacity;
  return ORB_OK;
}

void orb_star_free(orb_context *ctx, orb_star *star) {
  orb_free(ctx, star->block);
  memset(star, 0, sizeof *star);
}

orb_status orb_star_walk(orb_context *ctx, orb_star *star, const orb_corner_table *s, int32_t v, const double *point) {
  ORB_TRY(reserve(ctx, star, s->valence[v]));
  int32_t start = s->vertex_corner[v], c = start, k = 0;
  do {
    int32_t u = s->corner[orb_corner_next(c)];
    star->vertex[k] = u;
    star->corner[k] = c;
    memcpy(star->ring[k], point + 4 * (int64_t)u, sizeof star->ring[k]);
    k++;
    c = orb_corner_swing(s, c);
  } while (c != start);
  star->count = k;
  return ORB_OK;
}

/* Half cotangents at the three vertices, in order, of a triangle whose squared edges are blended. */
static void shape_cotangents(const orb_corner_table *s, int32_t a, int32_t b, int32_t c, double blend, double out[3]) {
  const double *p = s->position + 3 * (int64_t)a, *q = s->position + 3 * (int64_t)b;
  const double *r = s->position + 3 * (int64_t)c;
  double ab = orb_distance2(p, q), ac = orb_distance2(p, r), bc = orb_distance2(q, r);
  double more = blend * (ab + ac + bc) / 3 + TINY2;
  ab += more;
  ac += more;
  bc += more;
  double sum = ab + ac + bc, sixteen = 2 * (ab * ac + ac * bc + bc * ab) - (ab * ab + ac * ac + bc * bc);
  double area4 = sqrt(sixteen > 0 ? sixteen : 0);
  double half = 0.5 / (area4 > FLAT * sum ? area4 : FLAT * sum);
  out[0] = (ab + ac - bc) * half;
  out[1] = (ab + bc - ac) * half;
  out[2] = (ac + bc - ab) * half;
}

void orb_star_shape(orb_star *star, const orb_corner_table *s, int32_t v, double blend) {
  star->area = 0;
  for (int32_t i = 0; i < star->count; i++) {
    int32_t j = i + 1 < star->count ? i + 1 : 0;
    double half[3];
    shape_cotangents(s, v, star->vertex[i], star->vertex[j], blend, half);
    star->ca[i] = half[2];
    star->cb[i] = half[1];
    star->cc[i] = half[0] * orb_distance2(star->ring[i], star->ring[j]);
    double area = 2 * (double)orb_corner_area(s, star->corner[i]);
    star->area += area;
    star->a2[i] = area * area;
  }
}

/* Takes the ring to the frame of p. */
static void localise(orb_star *star, const double p[3], double e1[3], double e2[3]) {
  orb_tangent_frame(p, e1, e2);
  int32_t k = star->count;
  for (int32_t i = 0; i < k; i++) {
    double u[3];
    orb_sub(star->ring[i], p, u);
    star->x[i] = orb_dot(u, e1);
    star->y[i] = orb_dot(u, e2);
    star->z[i] = orb_dot(u, p);
  }
  for (int32_t i = 0; i < k; i++) {
    int32_t j = i + 1 < k ? i + 1 : 0;
    star->nz[i] = star->x[i] * star->y[j] - star->y[i] * star->x[j];
    star->nx[i] = star->y[i] * (1 + star->z[j]) - (1 + star->z[i]) * star->y[j];
    star->ny[i] = (1 + star->z[i]) * star->x[j] - star->x[i] * (1 + star->z[j]);
  }
}

/* The energy at tangent coordinates (s, t), pulled back to the sphere; infinite outside the kernel. */
static double energy_at(const orb_star *star, orb_newton_energy e, double s, double t) {
  double length = sqrt(1 + s * s + t * t), inverse = 1 / length;
  double x = s * inverse, y = t * inverse, z = -(s * s + t * t) * inverse / (length + 1), energy = 0;
  int32_t k = star->count;
  for (int32_t i = 0; i < k; i++) {
    int32_t j = i + 1 < k ? i + 1 : 0;
    double ax = star->x[i] - x, ay = star->y[i] - y, az = star->z[i] - z;
    double bx = star->x[j] - x, by = star->y[j] - y, bz = star->z[j] - z;
    double d = (s * star->nx[i] + t * star->ny[i] + star->nz[i]) * inverse;
    if (!(d > 1e-290)) {
      return INFINITY;
    }
    double dirichlet =
        star->ca[i] * (ax * ax + ay * ay + az * az) + star->cb[i] * (bx * bx + by * by + bz * bz) + star->cc[i];
    double h = star->a2[i] / (d * d);
    energy += dirichlet * (e.angle > 0 ? e.w + e.angle * sqrt(h) + e.area * h : e.w + e.area * h);
  }
  return energy;
}

typedef struct quadratic {
  double energy, gx, gy, hxx, hxy, hyy;
} quadratic;

/* Energy, gradient and Hessian at p; the energy is infinite where a triangle is not positive. */
static quadratic expand(const orb_star *star, orb_newton_energy e) {
  quadratic q = {0};
  int32_t k = star->count;
  for (int32_t i = 0; i < k; i++) {
    int32_t j = i + 1 < k ? i + 1 : 0;
    double d = star->nz[i], nx = star->nx[i], ny = star->ny[i], ca = star->ca[i], cb = star->cb[i];
    if (!(d > 1e-145)) {
      q.energy = INFINITY;
      return q;
    }
    double xi = star->x[i], yi = star->y[i], zi = star->z[i], xj = star->x[j], yj = star->y[j], zj = star->z[j];
    double dirichlet = ca * (xi * xi + yi * yi + zi * zi) + cb * (xj * xj + yj * yj + zj * zj) + star->cc[i];
    double r = 1 / d, h = e.area * (star->a2[i] * r * r), a = e.angle > 0 ? e.angle * sqrt(star->a2[i]) * r : 0;
    double f = e.w + h + a, c = -2 * h * r - a * r;
    double dx = -2 * (ca * xi + cb * xj), dy = -2 * (ca * yi + cb * yj);
    q.energy += dirichlet * f;
    q.gx += f * dx + c * dirichlet * nx;
    q.gy += f * dy + c * dirichlet * ny;
    double bend = f * 2 * (ca * (1 + zi) + cb * (1 + zj)) - c * dirichlet * d,
           g = (6 * dirichlet * h + 2 * dirichlet * a) * r * r;
    q.hxx += bend + 2 * c * dx * nx + g * nx * nx;
    q.hyy += bend + 2 * c * dy * ny + g * ny * ny;
    q.hxy += c * (dx * ny + dy * nx) + g * nx * ny;
  }
  return q;
}

/* The Newton direction, with the Hessian's eigenvalues kept positive; 0 if there is none. */
static int solve_step(quadratic q, double *s, double *t) {
  double middle = 0.5 * (q.hxx + q.hyy), half = 0.5 * (q.hxx - q.hyy), root = sqrt(half * half + q.hxy * q.hxy);
  double floor = EIGEN_FLOOR * fabs(middle + root), least = middle - root;
  double shift = least < floor ? floor - least : 0;
  q.hxx += shift;
  q.hyy += shift;
  double det = q.hxx * q.hyy - q.hxy * q.hxy;
  *s = -(q.hyy * q.gx - q.hxy * q.gy) / det;
  *t = -(q.hxx * q.gy - q.hxy * q.gx) / det;
  return isfinite(*s) && isfinite(*t) && (*s != 0 || *t != 0);
}

/* How much of the step may be taken: within the kernel, and at most half a radian. */
static double longest_step(const orb_star *star, double s, double t) {
  double tau = 1, length = sqrt(s * s + t * t);
  for (int32_t i = 0; i < star->count; i++) {
    double slope = s * star->nx[i] + t * star->ny[i];
    if (slope < 0 && tau * -slope > EDGE_SHARE * star->nz[i]) {
      tau = EDGE_SHARE * star->nz[i] / -slope;
    }
  }
  return tau * length > 0.5 ? 0.5 / length : tau;
}

double orb_star_newton(orb_star *star, orb_newton_energy e, double p[3], double *before) {
  double e1[3], e2[3], s, t;
  localise(star, p, e1, e2);
  quadratic q = expand(star, e);
  *before = q.energy;
  if (!isfinite(q.energy) || !solve_step(q, &s, &t)) {
    return q.energy;
  }
  double tau = longest_step(star, s, t);
  for (int i = 0; i < TRIES; i++, tau *= 0.4) {
    double energy = energy_at(star, e, tau * s, tau * t);
    if (energy < q.energy) {
      double moved[3];
      for (int k = 0; k < 3; k++) {
        moved[k] = p[k] + tau * (s * e1[k] + t * e2[k]);
      }
      orb_normalize(moved);
      if (orb_kernel_contains((const double(*)[3])star->ring, star->count, moved)) {
        memcpy(p, moved, sizeof moved);
        return energy;
      }
    }
  }
  return q.energy;
}
