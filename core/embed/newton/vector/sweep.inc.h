/* One damped Newton step of every vertex of a batch, lane by lane: the mathematics and the notation of star.h.
 *
 * Everything is computed from differences to the centre, never from products near 1. A step is over-relaxed, goes at
 * most 0.8 of the way to the nearest plane of the kernel, is halved once where the energy does not fall, and is dropped
 * where it still does not. A lane moves only where every new determinant exceeds 1e-14 times the star's radius. That is
 * far above what rounding of the stored point can do to a determinant (about 4e-16 times that radius). Lanes that start
 * below twice that bound are reported as stiff and left to the scalar step with its exact test. */

enum {
  SWEEP_TRIES = 2, /* lengths of a step: full and half */
  SWEEP_RING = 64  /* room for a ring; at least ORB_SWEEP_RING_MAX */
};

typedef struct sweep_star {
  vd x[SWEEP_RING], y[SWEEP_RING], z[SWEEP_RING];    /* ring in the frame of the centre */
  vd nx[SWEEP_RING], ny[SWEEP_RING], nz[SWEEP_RING]; /* d = s·nx + t·ny + nz */
  vd cc[SWEEP_RING], inverse[SWEEP_RING];            /* the constant part of D; 1/d */
  vd p[3], e1[3], e2[3];
  vd radius; /* of the ring */
  vd energy, gx, gy, hxx, hxy, hyy, thinnest;
} sweep_star;

/* Centre, frame (Duff et al. 2017) and ring. */
static inline void sweep_localise(const orb_sweep_job *job, int64_t batch, int k, sweep_star *q) {
  const int32_t *ring = job->ring + job->offset[batch] * LANES;
  vd_gather3(job->point, job->vertex + batch * LANES, q->p);
  vd p0 = q->p[0], p1 = q->p[1], p2 = q->p[2], one = vd_set(1);
  vd s = vd_choose(p2 < 0, -one, one), a = -one / (s + p2), b = p0 * p1 * a;
  q->e1[0] = one + s * p0 * p0 * a;
  q->e1[1] = s * b;
  q->e1[2] = -s * p0;
  q->e2[0] = b;
  q->e2[1] = s + p1 * p1 * a;
  q->e2[2] = -p1;
  for (int i = 0; i < k; i++) {
    vd u[3];
    vd_gather3(job->point, ring + (int64_t)i * LANES, u);
    u[0] -= p0;
    u[1] -= p1;
    u[2] -= p2;
    q->x[i] = u[0] * q->e1[0] + u[1] * q->e1[1] + u[2] * q->e1[2];
    q->y[i] = u[0] * q->e2[0] + u[1] * q->e2[1] + u[2] * q->e2[2];
    q->z[i] = u[0] * p0 + u[1] * p1 + u[2] * p2;
  }
}

/* Energy, gradient and Hessian at the centre. */
static inline void sweep_expand(const float *shape, vd w, int k, sweep_star *q) {
  vd zero = vd_set(0), energy = zero, gx = zero, gy = zero, hxx = zero, hxy = zero, hyy = zero, thin = vd_set(4);
  vd first = q->x[0] * q->x[0] + q->y[0] * q->y[0] + q->z[0] * q->z[0], l0 = first, far = first;
  for (int i = 0; i < k; i++) {
    int j = i + 1 < k ? i + 1 : 0;
    const float *at = shape + (int64_t)i * 4 * LANES;
    vd ca = vd_load_floats(at), cb = vd_load_floats(at + LANES), c0 = vd_load_floats(at + 2 * LANES);
    vd area = vd_load_floats(at + 3 * LANES);
    vd xi = q->x[i], yi = q->y[i], zi = q->z[i], xj = q->x[j], yj = q->y[j], zj = q->z[j];
    vd l1 = j ? xj * xj + yj * yj + zj * zj : first, d = xi * yj - yi * xj;
    vd ex = xi - xj, ey = yi - yj, ez = zi - zj;
    vd cc = c0 * (ex * ex + ey * ey + ez * ez), r = 1.0 / d, h = area * r;
    zi += 1.0;
    zj += 1.0;
    vd nx = yi * zj - zi * yj, ny = zi * xj - xi * zj;
    q->nx[i] = nx;
    q->ny[i] = ny;
    q->nz[i] = d;
    q->cc[i] = cc;
    q->inverse[i] = r;
    far = vd_max(far, l1);
    thin = vd_min(thin, d);
    vd dirichlet = ca * l0 + cb * l1 + cc;
    h = h * h;
    vd f = w + h, dx = -2.0 * (ca * xi + cb * xj), dy = -2.0 * (ca * yi + cb * yj);
    vd c = -2.0 * h * r, cd = c * dirichlet;
    energy += dirichlet * f;
    gx += f * dx + cd * nx;
    gy += f * dy + cd * ny;
    vd bend = f * (2.0 * (ca * zi + cb * zj)) - cd * d, g = -3.0 * cd * r, cx = c * nx, cy = c * ny;
    hxx += bend + 2.0 * cx * dx + g * nx * nx;
    hyy += bend + 2.0 * cy * dy + g * ny * ny;
    hxy += cx * dy + cy * dx + g * nx * ny;
    l0 = l1;
  }
  q->energy = energy;
  q->gx = gx;
  q->gy = gy;
  q->hxx = hxx;
  q->hxy = hxy;
  q->hyy = hyy;
  q->thinnest = thin;
  q->radius = vd_sqrt(far);
}

/* The Newton direction, with the Hessian's eigenvalues kept positive as in star.c; returns the first length to try. */
static inline vd sweep_direction(const sweep_star *q, double relax, int k, vd *s, vd *t) {
  vd zero = vd_set(0), middle = 0.5 * (q->hxx + q->hyy), half = 0.5 * (q->hxx - q->hyy);
  vd root = vd_sqrt(half * half + q->hxy * q->hxy);
  vd greatest = vd_max(middle + root, -(middle + root));
  vd shift = vd_max(0.05 * greatest - (middle - root), zero), hxx = q->hxx + shift, hyy = q->hyy + shift;
  vd det = 1.0 / (hxx * hyy - q->hxy * q->hxy);
  *s = -(hyy * q->gx - q->hxy * q->gy) * det;
  *t = -(hxx * q->gy - q->hxy * q->gx) * det;
  vd nearest = vd_set(1e-30); /* reciprocal of the distance to the nearest plane, in steps */
  for (int i = 0; i < k; i++) {
    nearest = vd_max(nearest, -(*s * q->nx[i] + *t * q->ny[i]) * q->inverse[i]);
  }
  vd length = vd_sqrt(*s * *s + *t * *t);
  vd tau = vd_min(vd_set(relax), 0.8 / nearest);
  return vd_min(tau, 0.5 / (length + 1e-300));
}

/* The energy at (s, t) on the sphere, and the smallest determinant there. */
static inline vd sweep_energy(const sweep_star *q, const float *shape, vd w, int k, vd s, vd t, vd *smallest) {
  vd square = s * s + t * t, length = vd_sqrt(square + 1.0), inverse = 1.0 / length;
  vd x = s * inverse, y = t * inverse, z = -square * inverse / (length + 1.0);
  vd ax = q->x[0] - x, ay = q->y[0] - y, az = q->z[0] - z, first = ax * ax + ay * ay + az * az, l0 = first;
  vd energy = vd_set(0), thin = vd_set(4);
  for (int i = 0; i < k; i++) {
    int j = i + 1 < k ? i + 1 : 0;
    const float *at = shape + (int64_t)i * 4 * LANES;
    vd l1 = first;
    if (j) {
      vd bx = q->x[j] - x, by = q->y[j] - y, bz = q->z[j] - z;
      l1 = bx * bx + by * by + bz * bz;
    }
    vd d = (s * q->nx[i] + t * q->ny[i] + q->nz[i]) * inverse;
    vd dirichlet = vd_load_floats(at) * l0 + vd_load_floats(at + LANES) * l1 + q->cc[i];
    vd h = vd_load_floats(at + 3 * LANES) / d;
    thin = vd_min(thin, d);
    energy += dirichlet * (w + h * h);
    l0 = l1;
  }
  *smallest = thin;
  return energy;
}

static inline void sweep_store(const orb_sweep_job *job, int64_t batch, const sweep_star *q, vm moved, vd s, vd t) {
  vd to[3];
  for (int k = 0; k < 3; k++) {
    to[k] = q->p[k] + s * q->e1[k] + t * q->e2[k];
  }
  vd length = vd_sqrt(to[0] * to[0] + to[1] * to[1] + to[2] * to[2]);
  for (int k = 0; k < 3; k++) {
    to[k] /= length;
  }
  for (int l = 0; l < job->fill[batch]; l++) {
    if (moved[l]) {
      double *p = job->point + 4 * (int64_t)job->vertex[batch * LANES + l];
      p[0] = to[0][l];
      p[1] = to[1][l];
      p[2] = to[2][l];
    }
  }
}

static inline void sweep_batch(const orb_sweep_job *job, int64_t batch) {
  sweep_star q;
  int k = job->valence[batch];
  if (k < 3 || k > ORB_SWEEP_RING_MAX) {
    __builtin_unreachable(); /* level.c makes no such batch */
  }
  const float *shape = job->shape + 4 * job->offset[batch] * LANES;
  vd w = vd_set(job->weight), s, t;
  sweep_localise(job, batch, k, &q);
  sweep_expand(shape, w, k, &q);
  vm stiff = ~(vm)(q.thinnest > 2e-14 * q.radius);
  vd tau = sweep_direction(&q, job->relax, k, &s, &t);
  vd after = q.energy, to_s = vd_set(0), to_t = to_s, least = 1e-14 * q.radius;
  vm todo = (vm)(tau > 0) & (vm)((s * s + t * t) > 0) & ~stiff, moved = todo & 0;
  for (int i = 0; i < SWEEP_TRIES && vm_any(todo); i++) {
    vd smallest, try_s = s * tau, try_t = t * tau;
    vd energy = sweep_energy(&q, shape, w, k, try_s, try_t, &smallest);
    vm good = todo & (vm)(energy < q.energy) & (vm)(smallest > least);
    to_s = vd_choose(good, try_s, to_s);
    to_t = vd_choose(good, try_t, to_t);
    after = vd_choose(good, energy, after);
    moved |= good;
    todo &= ~good;
    tau *= 0.5;
  }
  if (vm_any(moved)) {
    sweep_store(job, batch, &q, moved, to_s, to_t);
  }
  unsigned bits = 0;
  double energy = 0, fall = 0;
  for (int l = 0; l < job->fill[batch]; l++) {
    bits |= stiff[l] ? 1U << l : 0U;
    energy += stiff[l] ? 0 : q.energy[l];
    fall += stiff[l] ? 0 : q.energy[l] - after[l];
  }
  job->stiff[batch] = (unsigned char)bits;
  job->energy[batch] = energy;
  job->fall[batch] = fall;
}

static void sweep_range(const orb_sweep_job *job, int64_t begin, int64_t end) {
  for (int64_t i = begin; i < end; i++) {
    sweep_batch(job, i);
  }
}
