/* The energy of a composed map around one vertex, and a damped Newton step of it.
 *
 * A triangle of the moving shape with area a has three places on the fixed shape, and its image is the flat triangle of
 * their positions: D = ½ Σ cot·|edge|² is its Dirichlet energy and s its area, signed along the fixed shape's
 * interpolated normals (unsigned areas lock triangles inverted). E = D (1 + a²/χ(s)²) is the symmetric Dirichlet energy
 * with χ(s) = ½(s + √(s² + ε²)), the usual regularised positive part, so that a triangle inverted in space can turn
 * back. On the sphere a hinge barrier holds every determinant above a tenth of what the areas would give it, and a move
 * may not shrink one more than fivefold. The vertex moves straight over the fixed shape by the 2×2 Newton step.
 */
#include <math.h>
#include <string.h>

#include "align/compose_level.h"
#include "base/check.h"
#include "numeric/vec3.h"

enum { RING_MAX = 256, TRIES = 8, GRAIN = 32 };
static const double HINGE = 0.1;       /* where the sphere's barrier begins */
static const double SHRINK = 0.2;      /* least ratio of a determinant in one move */
static const double SOFT_BELOW = 0.05; /* below that the soft barrier goes on as a parabola */

typedef struct term {
  const double *q, *r;
  double cv, cq, cr, area, qr2;
  double grow[3]; /* s = ½ grow·(y − q) */
  double epsilon;
  double plane[3]; /* sphere: determinant = plane·x */
  double det, hinge;
} term;

static double chi(double s, double e) {
  double root = sqrt(s * s + e * e);
  return s >= 0 ? 0.5 * (s + root) : 0.5 * e * e / (root - s) + 1e-300;
}

/* r − 1 − ln r below 1, with its derivatives; soft: finite. */
static double barrier(double r, int soft, double *first, double *second) {
  if (!soft || r >= SOFT_BELOW) {
    *first = 1 - 1 / r;
    *second = 1 / (r * r);
    return r - 1 - log(r);
  }
  double r0 = SOFT_BELOW, d = r - r0;
  *second = 1 / (r0 * r0);
  *first = 1 - 1 / r0 + d * *second;
  return r0 - 1 - log(r0) + (1 - 1 / r0) * d + 0.5 * d * d * *second;
}

static double evaluate(const term *terms, int32_t count, const double y[3], const double x[3], const cm_rules *rules,
                       double shrink) {
  double energy = 0;
  for (int32_t i = 0; i < count; i++) {
    const term *t = &terms[i];
    double det = orb_dot(t->plane, x), u[3], first, second;
    if (!rules->soft && !(det > shrink * t->det)) {
      return INFINITY;
    }
    orb_sub(y, t->q, u);
    double d = 0.5 * (t->cv * t->qr2 + t->cq * orb_distance2(y, t->r) + t->cr * orb_dot(u, u));
    double h = t->area / chi(0.5 * orb_dot(t->grow, u), t->epsilon);
    energy += d * (1 + h * h);
    if (det * t->hinge < 1) {
      energy += rules->barrier * t->area * barrier(det * t->hinge, rules->soft, &first, &second);
    }
  }
  return energy;
}

typedef struct newton {
  double energy, g[2], h[3];
} newton;

/* Derivative of the point on the sphere by the two tangents of the place's triangle. */
static void sphere_jacobian(const cm_surface *b, const orb_place *place, const double x[3], double j1[3],
                            double j2[3]) {
  const int32_t *v = b->triangles + 3 * (size_t)place->triangle;
  const double *e1 = b->frame + 6 * (size_t)place->triangle, *e2 = e1 + 3;
  const double *p = b->x + 3 * (size_t)v[0], *q = b->x + 3 * (size_t)v[1], *r = b->x + 3 * (size_t)v[2];
  double u[3], w[3], at[3];
  orb_sub(q, p, u);
  orb_sub(r, p, w);
  double u1 = orb_dot(u, e1), u2 = orb_dot(u, e2), w1 = orb_dot(w, e1), w2 = orb_dot(w, e2);
  double det = u1 * w2 - u2 * w1, inverse = fabs(det) > 1e-300 ? 1 / det : 0;
  for (int k = 0; k < 3; k++) {
    at[k] = place->at[0] * b->s[3 * (size_t)v[0] + (size_t)k] + place->at[1] * b->s[3 * (size_t)v[1] + (size_t)k] +
            place->at[2] * b->s[3 * (size_t)v[2] + (size_t)k];
  }
  double scale = inverse / (orb_length(at) + 1e-300);
  for (int k = 0; k < 3; k++) {
    double du = b->s[3 * (size_t)v[1] + (size_t)k] - b->s[3 * (size_t)v[0] + (size_t)k];
    double dw = b->s[3 * (size_t)v[2] + (size_t)k] - b->s[3 * (size_t)v[0] + (size_t)k];
    j1[k] = (du * w2 - dw * u2) * scale;
    j2[k] = (dw * u1 - du * w1) * scale;
  }
  double p1 = orb_dot(j1, x), p2 = orb_dot(j2, x);
  for (int k = 0; k < 3; k++) {
    j1[k] -= p1 * x[k];
    j2[k] -= p2 * x[k];
  }
}

/* The in-plane area part of a term, added to the Newton system. */
static void add_stretch(term *t, const cm_rules *rules, const double y[3], const double *e1, const double *e2,
                        newton *n) {
  double u[3], z[3];
  orb_sub(y, t->q, u);
  orb_sub(y, t->r, z);
  double s = 0.5 * orb_dot(t->grow, u), s1 = 0.5 * orb_dot(t->grow, e1), s2 = 0.5 * orb_dot(t->grow, e2);
  double d = 0.5 * (t->cv * t->qr2 + t->cq * orb_dot(z, z) + t->cr * orb_dot(u, u));
  double d1 = t->cq * orb_dot(z, e1) + t->cr * orb_dot(u, e1), d2 = t->cq * orb_dot(z, e2) + t->cr * orb_dot(u, e2);
  double dd = t->cq + t->cr;
  t->epsilon = rules->epsilon * (fmin(0.5 * d, t->area) + 1e-4 * t->area);
  double e = t->epsilon, root = sqrt(s * s + e * e), c = chi(s, e), c1 = c / root;
  double c2 = 0.5 * e * e / (root * root * root), h = t->area / c;
  h *= h;
  double f = 1 + h, fp = -2 * h * c1 / c, fpp = fmax(0, 6 * h * c1 * c1 / (c * c) - 2 * h * c2 / c);
  n->energy += d * f;
  n->g[0] += f * d1 + d * fp * s1;
  n->g[1] += f * d2 + d * fp * s2;
  n->h[0] += f * dd + 2 * fp * d1 * s1 + d * fpp * s1 * s1;
  n->h[1] += fp * (d1 * s2 + d2 * s1) + d * fpp * s1 * s2;
  n->h[2] += f * dd + 2 * fp * d2 * s2 + d * fpp * s2 * s2;
}

static void add_hinge(const term *t, const cm_rules *rules, const double j1[3], const double j2[3], newton *n) {
  double r = t->det * t->hinge, first, second;
  if (r >= 1) {
    return;
  }
  double q = rules->barrier * t->area;
  n->energy += q * barrier(r, rules->soft, &first, &second);
  double g1 = orb_dot(t->plane, j1) * t->hinge, g2 = orb_dot(t->plane, j2) * t->hinge;
  n->g[0] += q * first * g1;
  n->g[1] += q * first * g2;
  n->h[0] += q * second * g1 * g1;
  n->h[1] += q * second * g1 * g2;
  n->h[2] += q * second * g2 * g2;
}

/* Loads the star of v. */
static int32_t load_terms(const cm_level *l, const cm_surface *b, int32_t v, term *terms) {
  int32_t count = 0;
  const double *x = l->x + 3 * (size_t)v;
  for (int32_t i = l->start[v]; i < l->start[v + 1]; i++) {
    const cm_spoke *s = &l->spoke[i];
    term *t = &terms[count++];
    t->q = l->y + 3 * (size_t)s->q;
    t->r = l->y + 3 * (size_t)s->r;
    t->cv = s->cv;
    t->cq = s->cq;
    t->cr = s->cr;
    t->area = s->area;
    double side[3], normal[3];
    orb_sub(t->r, t->q, side);
    t->qr2 = orb_dot(side, side);
    for (int k = 0; k < 3; k++) {
      normal[k] =
          l->n[3 * (size_t)v + (size_t)k] + l->n[3 * (size_t)s->q + (size_t)k] + l->n[3 * (size_t)s->r + (size_t)k];
    }
    if (orb_normalize(normal) < 0.3) { /* the normals cancel: take the triangle's own */
      double u[3];
      orb_sub(l->y + 3 * (size_t)v, t->q, u);
      orb_cross(side, u, normal);
      orb_normalize(normal);
    }
    orb_cross(normal, side, t->grow);
    const double *xq = l->x + 3 * (size_t)s->q, *xr = l->x + 3 * (size_t)s->r;
    double along[3];
    orb_sub(xr, xq, along);
    orb_cross(xq, along, t->plane);
    t->det = orb_dot(t->plane, x);
    double density = fmin(b->density[l->place[v].triangle],
                          fmin(b->density[l->place[s->q].triangle], b->density[l->place[s->r].triangle]));
    t->hinge = 1 / (HINGE * 2 * t->area * density + 1e-300);
  }
  return count;
}

/* The Newton direction, with the Hessian made positive definite; 0 where it is no descent worth a try. */
static int solve(const newton *n, double step[2], double *slope) {
  double h0 = n->h[0], h1 = n->h[1], h2 = n->h[2], mean = 0.5 * (h0 + h2);
  double root = sqrt(0.25 * (h0 - h2) * (h0 - h2) + h1 * h1), low = mean - root;
  double floor = 0.05 * fmax(fabs(mean + root), fabs(low));
  if (low < floor) {
    h0 += floor - low;
    h2 += floor - low;
  }
  double det = h0 * h2 - h1 * h1;
  step[0] = -(h2 * n->g[0] - h1 * n->g[1]) / det;
  step[1] = -(h0 * n->g[1] - h1 * n->g[0]) / det;
  *slope = n->g[0] * step[0] + n->g[1] * step[1];
  return *slope < 0 && -*slope >= 1e-12 * fabs(n->energy);
}

static double pull_energy(const cm_level *l, int32_t v, const double y[3]) {
  return l->pull[v] > 0 ? l->pull[v] * orb_distance2(y, l->goal + 3 * (size_t)v) : 0;
}

/* Returns how far the vertex moved. */
static double step_vertex(cm_level *l, const cm_surface *b, const cm_rules *rules, int32_t v, term *terms) {
  if (l->pinned[v] || l->start[v + 1] - l->start[v] > RING_MAX) {
    return 0;
  }
  double *y = l->y + 3 * (size_t)v, *x = l->x + 3 * (size_t)v, j1[3], j2[3], step[2], slope, longest = 0;
  const double *e1 = b->frame + 6 * (size_t)l->place[v].triangle, *e2 = e1 + 3;
  newton n = {0};
  int32_t count = load_terms(l, b, v, terms);
  sphere_jacobian(b, &l->place[v], x, j1, j2);
  for (int32_t i = 0; i < count; i++) {
    add_stretch(&terms[i], rules, y, e1, e2, &n);
    add_hinge(&terms[i], rules, j1, j2, &n);
    longest = fmax(longest, terms[i].qr2);
  }
  if (l->pull[v] > 0) {
    double d[3];
    orb_sub(y, l->goal + 3 * (size_t)v, d);
    n.energy += l->pull[v] * orb_dot(d, d);
    n.g[0] += 2 * l->pull[v] * orb_dot(d, e1);
    n.g[1] += 2 * l->pull[v] * orb_dot(d, e2);
    n.h[0] += 2 * l->pull[v];
    n.h[2] += 2 * l->pull[v];
  }
  if (!solve(&n, step, &slope)) {
    return 0;
  }
  double length = sqrt(step[0] * step[0] + step[1] * step[1]), t = rules->omega;
  t = t * length > sqrt(longest) ? sqrt(longest) / length : t;
  for (int tries = 0; tries < TRIES; tries++) {
    const double scaled[2] = {t * step[0], t * step[1]};
    orb_place place;
    double ny[3], nx[3], nn[3];
    if (cm_surface_trace(b, &l->place[v], scaled, &place)) {
      cm_surface_at(b, &place, ny, nx, nn);
      double energy = evaluate(terms, count, ny, nx, rules, SHRINK) + pull_energy(l, v, ny);
      if (energy <= n.energy + (t > 1 ? 0 : 1e-4 * t * slope)) {
        l->place[v] = place;
        memcpy(y, ny, sizeof ny);
        memcpy(x, nx, sizeof nx);
        memcpy(l->n + 3 * (size_t)v, nn, sizeof nn);
        return t * length;
      }
    }
    t = t > 1 ? 1 : 0.4 * t;
  }
  return 0;
}

void cm_level_step(cm_level *l, const cm_surface *b, const cm_rules *rules, int32_t v) {
  term terms[RING_MAX];
  (void)step_vertex(l, b, rules, v, terms);
}

int cm_level_try(cm_level *l, const cm_surface *b, const cm_rules *rules, int32_t v, const orb_place *place) {
  term terms[RING_MAX];
  double y[3], x[3], n[3];
  if (l->pinned[v] || l->start[v + 1] - l->start[v] > RING_MAX) {
    return 0;
  }
  int32_t count = load_terms(l, b, v, terms);
  newton present = {0};
  for (int32_t i = 0; i < count; i++) { /* sets the terms' ε */
    add_stretch(&terms[i], rules, l->y + 3 * (size_t)v, b->frame, b->frame + 3, &present);
  }
  cm_surface_at(b, place, y, x, n);
  double before = evaluate(terms, count, l->y + 3 * (size_t)v, l->x + 3 * (size_t)v, rules, 0);
  if (!(evaluate(terms, count, y, x, rules, 0) < before)) {
    return 0;
  }
  l->place[v] = *place;
  memcpy(l->y + 3 * (size_t)v, y, sizeof y);
  memcpy(l->x + 3 * (size_t)v, x, sizeof x);
  memcpy(l->n + 3 * (size_t)v, n, sizeof n);
  l->moved[v] = INFINITY;
  return 1;
}

/* Whether anything around v has moved since it was last optimal. */
static int is_stirred(const cm_level *l, int32_t v, double still) {
  if (l->moved[v] > still) {
    return 1;
  }
  for (int32_t i = l->start[v]; i < l->start[v + 1]; i++) {
    if (l->moved[l->spoke[i].q] > still && !l->pinned[l->spoke[i].q]) {
      return 1;
    }
  }
  return 0;
}

typedef struct sweep_job {
  cm_level *level;
  const cm_surface *b;
  const cm_rules *rules;
  int32_t first;
  double *moved; /* of each chunk */
  int32_t *stepped;
} sweep_job;

static void sweep_range(void *arg, int64_t begin, int64_t end, int thread) {
  const sweep_job *job = arg;
  cm_level *l = job->level;
  term terms[RING_MAX];
  double sum = 0;
  int32_t stepped = 0;
  (void)thread;
  for (int64_t i = begin; i < end; i++) {
    int32_t v = l->by_colour[job->first + i];
    if (is_stirred(l, v, job->rules->still)) {
      l->moved[v] = step_vertex(l, job->b, job->rules, v, terms);
      sum += l->moved[v];
      stepped++;
    } else {
      l->moved[v] = 0;
    }
  }
  job->moved[begin / GRAIN] = sum;
  job->stepped[begin / GRAIN] = stepped;
}

orb_status cm_level_sweep(orb_context *ctx, cm_level *l, const cm_surface *b, const cm_rules *rules, double *moved,
                          int32_t *stepped) {
  double sum = 0, *part = ORB_NEW(ctx, double, l->count / GRAIN + 1);
  int32_t total = 0, *steps = ORB_NEW(ctx, int32_t, l->count / GRAIN + 1);
  orb_status status = part && steps ? ORB_OK : ORB_E_NO_MEMORY;
  for (int c = 0; c < l->colours && status == ORB_OK; c++) {
    int32_t first = l->colour_start[c], count = l->colour_start[c + 1] - first;
    sweep_job job = {l, b, rules, first, part, steps};
    orb_parallel_for(ctx, count, GRAIN, sweep_range, &job);
    for (int32_t i = 0; i * GRAIN < count; i++) {
      sum += part[i];
      total += steps[i];
    }
    status = orb_context_check(ctx);
  }
  orb_free(ctx, part);
  orb_free(ctx, steps);
  *moved = l->count ? sum / l->count : 0;
  *stepped = total;
  return status;
}
