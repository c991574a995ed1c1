/* A damped Newton step of one vertex of a composed map (its energy: star.c), and sweeps of such steps.
 *
 * The vertex moves straight over the fixed shape by the 2×2 Newton step. A step that shrinks a determinant on the
 * sphere too much (params.step.shrink) is shortened.
 */
#include <math.h>
#include <string.h>

#include "align/map/engine/star.h"
#include "align/map/engine/step.h"
#include "base/check.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/vec3.h"

enum { GRAIN = 32 }; /* vertices of a chunk of a sweep */

/* Derivatives of the point on the sphere with respect to the two tangents of the place's triangle. */
static void sphere_jacobian(const orb_map_surface *b, const orb_place *place, const double x[3], double j1[3],
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

/* The Newton direction, with the Hessian made positive definite; 0 where it descends too little to be tried. */
static int solve(const orb_map_params *params, const orb_map_newton *n, double step[2], double *slope) {
  double h0 = n->h[0], h1 = n->h[1], h2 = n->h[2], mean = 0.5 * (h0 + h2);
  double root = sqrt(0.25 * (h0 - h2) * (h0 - h2) + h1 * h1), low = mean - root;
  double floor = params->step.convexity * fmax(fabs(mean + root), fabs(low));
  if (low < floor) {
    h0 += floor - low;
    h2 += floor - low;
  }
  double det = h0 * h2 - h1 * h1;
  step[0] = -(h2 * n->g[0] - h1 * n->g[1]) / det;
  step[1] = -(h0 * n->g[1] - h1 * n->g[0]) / det;
  *slope = n->g[0] * step[0] + n->g[1] * step[1];
  return *slope < 0 && -*slope >= params->step.least_slope * fabs(n->energy);
}

static double pull_energy(const orb_map_level *l, int32_t v, const double y[3]) {
  return l->pull[v] > 0 ? l->pull[v] * orb_distance2(y, l->target + 3 * (size_t)v) : 0;
}

/* The Newton system of v, with the pull to its spatial target. */
static void gather_system(const orb_map_level *l, const orb_map_surface *b, const orb_map_rules *rules, int32_t v,
                          orb_map_star *star, orb_map_newton *n) {
  const double *y = l->y + 3 * (size_t)v, *e1 = b->frame + 6 * (size_t)l->place[v].triangle, *e2 = e1 + 3;
  double j1[3], j2[3];
  orb_map_star_load(star, l, v);
  if (star->hinged) {
    sphere_jacobian(b, &l->place[v], l->x + 3 * (size_t)v, j1, j2);
  }
  orb_map_star_system(star, rules, y, e1, e2, star->hinged ? j1 : NULL, j2, n);
  if (l->pull[v] > 0) {
    double d[3];
    orb_sub(y, l->target + 3 * (size_t)v, d);
    n->energy += l->pull[v] * orb_dot(d, d);
    n->g[0] += 2 * l->pull[v] * orb_dot(d, e1);
    n->g[1] += 2 * l->pull[v] * orb_dot(d, e2);
    n->h[0] += 2 * l->pull[v];
    n->h[2] += 2 * l->pull[v];
  }
}

static void put(orb_map_level *l, const orb_map_surface *b, int32_t v, const orb_place *place, const double y[3],
                const double x[3]) {
  l->place[v] = *place;
  l->density[v] = b->density[place->triangle];
  memcpy(l->y + 3 * (size_t)v, y, sizeof(double[3]));
  memcpy(l->x + 3 * (size_t)v, x, sizeof(double[3]));
  orb_map_surface_at(b, place, NULL, NULL, l->n + 3 * (size_t)v);
}

static double longest_side(const orb_map_star *star) {
  double longest = 0;
  for (int32_t i = 0; i < star->count; i++) {
    double qr2 = star->lanes[i / ORB_MAP_LANES].qr2[i % ORB_MAP_LANES];
    longest = qr2 > longest ? qr2 : longest;
  }
  return sqrt(longest);
}

/* Returns how far the vertex moved. */
static double step_vertex(orb_map_level *l, const orb_map_surface *b, const orb_map_rules *rules, int32_t v,
                          orb_map_star *star) {
  if (l->pinned[v] || l->start[v + 1] - l->start[v] > ORB_MAP_RING_MAX) {
    return 0;
  }
  double step[2], slope;
  orb_map_newton n;
  gather_system(l, b, rules, v, star, &n);
  const orb_map_params *params = l->params;
  if (!solve(params, &n, step, &slope)) {
    return 0;
  }
  double length = sqrt(step[0] * step[0] + step[1] * step[1]), most = longest_side(star), t = rules->omega;
  t = t * length > most ? most / length : t;
  for (int tries = 0; tries < params->step.tries; tries++) {
    const double scaled[2] = {t * step[0], t * step[1]};
    orb_place place;
    double y[3], x[3];
    if (orb_map_surface_trace(b, &l->place[v], scaled, &place)) {
      orb_map_surface_at(b, &place, y, x, NULL);
      double energy = orb_map_star_energy(star, rules, y, x, params->step.shrink) + pull_energy(l, v, y);
      if (energy <= n.energy + (t > 1 ? 0 : params->step.sufficient * t * slope)) {
        put(l, b, v, &place, y, x);
        return t * length;
      }
    }
    t = t > 1 ? 1 : params->step.shorten * t;
  }
  return 0;
}

void orb_map_level_step(orb_map_level *l, const orb_map_surface *b, const orb_map_rules *rules, int32_t v) {
  orb_map_star star;
  (void)step_vertex(l, b, rules, v, &star);
}

int orb_map_level_try(orb_map_level *l, const orb_map_surface *b, const orb_map_rules *rules, int32_t v,
                      const orb_place *place) {
  orb_map_star star;
  orb_map_newton present;
  double y[3], x[3];
  const double *old_y = l->y + 3 * (size_t)v, *old_x = l->x + 3 * (size_t)v;
  if (l->pinned[v] || l->start[v + 1] - l->start[v] > ORB_MAP_RING_MAX) {
    return 0;
  }
  orb_map_star_load(&star, l, v);
  orb_map_star_system(&star, rules, old_y, b->frame, b->frame + 3, NULL, NULL, &present); /* sets ε */
  orb_map_surface_at(b, place, y, x, NULL);
  if (!(orb_map_star_energy(&star, rules, y, x, 0) < orb_map_star_energy(&star, rules, old_y, old_x, 0))) {
    return 0;
  }
  put(l, b, v, place, y, x);
  l->moved[v] = INFINITY;
  return 1;
}

/* Has anything around v moved since v was last optimal? */
static int is_stirred(const orb_map_level *l, int32_t v, double still) {
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
  orb_map_level *level;
  const orb_map_surface *b;
  const orb_map_rules *rules;
  int32_t first;
  double *moved; /* of each chunk */
  int32_t *stepped;
} sweep_job;

static void fetch(const void *at) {
  __builtin_prefetch(at, 0, 3);
}

/* Prefetches what a step of v reads: its neighbours and its place. */
static void fetch_star(const orb_map_level *l, const orb_map_surface *b, int32_t v) {
  size_t t = (size_t)l->place[v].triangle;
  fetch(b->triangles + 3 * t);
  fetch(b->frame + 6 * t);
  fetch(b->frame + 6 * t + 5);
  fetch(b->density + t);
  for (int32_t i = l->start[v]; i < l->start[v + 1]; i++) {
    size_t q = (size_t)l->spoke[i].q;
    fetch(l->y + 3 * q);
    fetch(l->y + 3 * q + 2);
    fetch(l->x + 3 * q);
    fetch(l->x + 3 * q + 2);
    fetch(l->n + 3 * q);
    fetch(l->n + 3 * q + 2);
    fetch(l->density + q);
  }
}

/* Prefetches the surface there. */
static void fetch_surface(const orb_map_level *l, const orb_map_surface *b, int32_t v) {
  const int32_t *corner = b->triangles + 3 * (size_t)l->place[v].triangle;
  for (int k = 0; k < 3; k++) {
    size_t u = (size_t)corner[k];
    fetch(b->x + 3 * u);
    fetch(b->s + 3 * u);
    fetch(b->normal + 3 * u);
  }
}

/* No two vertices of a chunk are neighbours, so which of them step is known before any does. This lets a step's data
 * be prefetched while the steps before it are computed. */
static void sweep_range(void *arg, int64_t begin, int64_t end, int thread) {
  const sweep_job *job = arg;
  orb_map_level *l = job->level;
  orb_map_star star;
  double sum = 0;
  int32_t stirred[GRAIN], count = 0;
  (void)thread;
  for (int64_t i = begin; i < end; i++) {
    int32_t v = l->by_colour[job->first + i];
    if (is_stirred(l, v, job->rules->still)) {
      stirred[count++] = v;
    } else {
      l->moved[v] = 0;
    }
  }
  for (int32_t i = 0; i < count; i++) {
    if (i + 2 < count) {
      fetch_star(l, job->b, stirred[i + 2]);
    }
    if (i + 1 < count) {
      fetch_surface(l, job->b, stirred[i + 1]);
    }
    int32_t v = stirred[i];
    l->moved[v] = step_vertex(l, job->b, job->rules, v, &star);
    sum += l->moved[v];
  }
  job->moved[begin / GRAIN] = sum;
  job->stepped[begin / GRAIN] = count;
}

orb_status orb_map_level_sweep(orb_context *ctx, orb_map_level *l, const orb_map_surface *b, const orb_map_rules *rules,
                               double *moved, int32_t *stepped) {
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
