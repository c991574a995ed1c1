/* The energy of the stars of a batch, or of half of one, as a function of their centres: the mathematics and the
 * notation of ../star.h. sweep.inc.h includes this twice, for floats and for doubles, after naming
 *   STAR(x)      x with the suffix of the type
 *   SV, SM       vectors of numbers and of masks
 *   SV_SET, SV_SQRT, SV_RECIPROCAL, SV_MAX, SV_MIN, SV_CHOOSE   operations
 *   SV_ROW       loads one row of shapes
 * and undefines these names at its end.
 *
 * Lengths on the sphere are multiplied by `scale`, so that floats have room for small triangles; areas, energies and
 * determinants by its square. Everything is computed from differences to the centre, never from products near 1.
 *
 * A ring that is shorter than its batch's longest is filled up with its first vertex. Such triangles have the shape 0,
 * and `count` masks their determinants. */

typedef struct STAR(sweep_entry) {
  SV x, y, z;     /* ring in the frame of the centre */
  SV nx, ny, nz;  /* d = s·nx + t·ny + nz */
  SV cc, inverse; /* the constant part of D; 1/d */
} STAR(sweep_entry);

typedef struct STAR(sweep_star) {
  STAR(sweep_entry) ring[SWEEP_RING];
  SV scale, down, flatness,
      least; /* 1/scale; a determinant is surely positive above flatness · (squared sides) + least · radius */
  SV radius; /* of the ring */
  SV energy, gx, gy, hxx, hxy, hyy;
  SV s, t, tau; /* the step, and how much of it is tried */
  SV spare;     /* least determinant less what it must exceed */
} STAR(sweep_star);

/* The weights of the parts of the energy. */
typedef struct STAR(sweep_weights) {
  SV w, angle, area;
} STAR(sweep_weights);

/* Energy, gradient and Hessian at the centre. The first `full` entries are part of every ring. */
static inline void STAR(sweep_expand)(const float *shape, STAR(sweep_weights) e, int k, int full, SV count,
                                      STAR(sweep_star) * q) {
  SV zero = SV_SET(0), energy = zero, gx = zero, gy = zero, hxx = zero, hxy = zero, hyy = zero, spare = SV_SET(1e30F);
  SV down = q->down, down2 = down * down, up2 = q->scale * q->scale;
  SV first = q->ring[0].x * q->ring[0].x + q->ring[0].y * q->ring[0].y + q->ring[0].z * q->ring[0].z, l0 = first,
     far = first;
  for (int i = 0; i < k; i++) {
    int j = i + 1 < k ? i + 1 : 0;
    const float *at = shape + (int64_t)i * 4 * BATCH;
    SV ca = SV_ROW(at), cb = SV_ROW(at + BATCH), c0 = SV_ROW(at + 2 * BATCH), area = SV_ROW(at + 3 * BATCH) * up2;
    SV xi = q->ring[i].x, yi = q->ring[i].y, zi = q->ring[i].z, xj = q->ring[j].x, yj = q->ring[j].y, zj = q->ring[j].z;
    SV l1 = j ? xj * xj + yj * yj + zj * zj : first, d = xi * yj - yi * xj;
    if (i >= full) {
      d = SV_CHOOSE(count > SV_SET((float)i), d, up2);
    }
    SV ex = xi - xj, ey = yi - yj, ez = zi - zj;
    SV cc = c0 * (ex * ex + ey * ey + ez * ez), r = SV_RECIPROCAL(d), h = area * r;
    zi = zi * down + 1;
    zj = zj * down + 1;
    SV nx = yi * zj - zi * yj, ny = zi * xj - xi * zj;
    q->ring[i].nx = nx;
    q->ring[i].ny = ny;
    q->ring[i].nz = d;
    q->ring[i].cc = cc;
    q->ring[i].inverse = r;
    far = SV_MAX(far, l1);
    spare = SV_MIN(spare, d - q->flatness * (l0 + l1));
    SV dirichlet = ca * l0 + cb * l1 + cc;
    SV a = e.angle * h;
    h = e.area * (h * h);
    SV f = e.w + h + a, dx = -2 * (ca * xi + cb * xj), dy = -2 * (ca * yi + cb * yj);
    SV c = -2 * h * r - a * r, cd = c * dirichlet;
    energy += dirichlet * f;
    gx += f * dx + cd * nx;
    gy += f * dy + cd * ny;
    SV bend = f * (2 * (ca * zi + cb * zj)) - cd * d * down2, g = -3 * cd * r - a * dirichlet * r * r, cx = c * nx,
       cy = c * ny;
    hxx += bend + 2 * cx * dx + g * nx * nx;
    hyy += bend + 2 * cy * dy + g * ny * ny;
    hxy += cx * dy + cy * dx + g * nx * ny;
    l0 = l1;
  }
  q->energy = energy;
  q->gx = gx;
  q->gy = gy;
  q->hxx = hxx;
  q->hxy = hxy;
  q->hyy = hyy;
  q->radius = SV_SQRT(far);
  q->spare = spare - q->least * q->radius;
}

/* The Newton direction, with the Hessian's eigenvalues kept positive as in star.c, and the first length to try. */
static inline void STAR(sweep_direction)(STAR(sweep_star) * q, SV relax, int k) {
  SV zero = SV_SET(0), middle = (q->hxx + q->hyy) / 2, half = (q->hxx - q->hyy) / 2;
  SV root = SV_SQRT(half * half + q->hxy * q->hxy);
  SV greatest = SV_MAX(middle + root, -(middle + root));
  SV shift = SV_MAX(greatest / 20 - (middle - root), zero), hxx = q->hxx + shift, hyy = q->hyy + shift;
  SV det = SV_SET(1) / (hxx * hyy - q->hxy * q->hxy);
  SV s = -(hyy * q->gx - q->hxy * q->gy) * det, t = -(hxx * q->gy - q->hxy * q->gx) * det;
  SV nearest = SV_SET(1e-30F); /* reciprocal of the distance to the nearest plane, in steps */
  for (int i = 0; i < k; i++) {
    nearest = SV_MAX(nearest, -(s * q->ring[i].nx + t * q->ring[i].ny) * q->ring[i].inverse);
  }
  SV length = SV_SQRT(s * s + t * t);
  q->s = s;
  q->t = t;
  q->tau = SV_MIN(SV_MIN(relax, SV_SET(0.8F) / nearest), q->scale / (2 * length + SV_SET(1e-30F)));
}

/* The energy at (s, t) on the sphere; *spare as in sweep_star. */
static inline SV STAR(sweep_energy)(const STAR(sweep_star) * q, const float *shape, STAR(sweep_weights) e, int k, SV s,
                                    SV t, SV *spare) {
  SV down = q->down, up2 = q->scale * q->scale, square = (s * s + t * t) * down * down;
  SV length = SV_SQRT(square + 1), inverse = SV_SET(1) / length;
  SV x = s * inverse, y = t * inverse, z = -square * inverse / (length + 1) * q->scale;
  SV ax = q->ring[0].x - x, ay = q->ring[0].y - y, az = q->ring[0].z - z, first = ax * ax + ay * ay + az * az,
     l0 = first;
  SV energy = SV_SET(0), thin = SV_SET(1e30F);
  for (int i = 0; i < k; i++) {
    int j = i + 1 < k ? i + 1 : 0;
    const float *at = shape + (int64_t)i * 4 * BATCH;
    SV l1 = first;
    if (j) {
      SV bx = q->ring[j].x - x, by = q->ring[j].y - y, bz = q->ring[j].z - z;
      l1 = bx * bx + by * by + bz * bz;
    }
    SV d = (s * q->ring[i].nx + t * q->ring[i].ny + q->ring[i].nz) * inverse;
    SV dirichlet = SV_ROW(at) * l0 + SV_ROW(at + BATCH) * l1 + q->ring[i].cc;
    SV h = SV_ROW(at + 3 * BATCH) * up2 * SV_RECIPROCAL(d);
    thin = SV_MIN(thin, d - q->flatness * (l0 + l1));
    energy += dirichlet * (e.w + h * (e.angle + e.area * h));
    l0 = l1;
  }
  *spare = thin - q->least * q->radius;
  return energy;
}

/* One length of the step. `todo`: the lanes that have not moved; those that move now leave it. Then the next is half as
 * long. *s, *t, *after: where the lanes are, and their energy there. */
static inline void STAR(sweep_try)(STAR(sweep_star) * q, const float *shape, STAR(sweep_weights) e, int k, SM *todo,
                                   SV *s, SV *t, SV *after) {
  SV spare, try_s = q->s * q->tau, try_t = q->t * q->tau;
  SV energy = STAR(sweep_energy)(q, shape, e, k, try_s, try_t, &spare);
  SM good = *todo & (SM)(energy < q->energy) & (SM)(spare > SV_SET(0));
  *s = SV_CHOOSE(good, try_s, *s);
  *t = SV_CHOOSE(good, try_t, *t);
  *after = SV_CHOOSE(good, energy, *after);
  *todo &= ~good;
  q->tau /= 2;
}

/* The lanes that have a step to try. */
static inline SM STAR(sweep_todo)(const STAR(sweep_star) * q) {
  return (SM)(q->tau > SV_SET(0)) & (SM)((q->s * q->s + q->t * q->t) > SV_SET(0));
}

#undef STAR
#undef SV
#undef SM
#undef SV_SET
#undef SV_SQRT
#undef SV_RECIPROCAL
#undef SV_MAX
#undef SV_MIN
#undef SV_CHOOSE
#undef SV_ROW
