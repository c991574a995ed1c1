/* A damped Newton step of one vertex of a composed map (its energy: star.c). Sweeps take it for vertices with many
 * neighbours; for all others vector/ has the same step for several vertices at once.
 *
 * The vertex moves straight over the fixed shape by the 2×2 Newton step. A step that shrinks a determinant on the
 * sphere too much (params.step.shrink) is shortened.
 */
#include "align/map/engine/step.h"

#include <math.h>
#include <string.h>

#include "align/map/engine/star.h"
#include "numeric/vec3.h"

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
  double det = u1 * w2 - u2 * w1, inverse = fabs(det) > ORB_TINY ? 1 / det : 0;
  for (int k = 0; k < 3; k++) {
    at[k] = place->at[0] * b->s[3 * (size_t)v[0] + (size_t)k] + place->at[1] * b->s[3 * (size_t)v[1] + (size_t)k] +
            place->at[2] * b->s[3 * (size_t)v[2] + (size_t)k];
  }
  double scale = inverse / (orb_length(at) + ORB_TINY);
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

double orb_map_level_step(orb_map_level *l, const orb_map_surface *b, const orb_map_rules *rules, int32_t v) {
  if (l->pinned[v] || l->start[v + 1] - l->start[v] > ORB_MAP_RING_MAX) {
    return 0;
  }
  orb_map_star star;
  orb_map_newton n;
  double step[2], slope;
  gather_system(l, b, rules, v, &star, &n);
  const orb_map_params *params = l->params;
  if (!solve(params, &n, step, &slope)) {
    return 0;
  }
  double length = sqrt(step[0] * step[0] + step[1] * step[1]), most = longest_side(&star), t = rules->omega;
  t = t * length > most ? most / length : t;
  for (int tries = 0; tries < params->step.tries; tries++) {
    const double scaled[2] = {t * step[0], t * step[1]};
    orb_place place;
    double y[3], x[3];
    if (orb_map_surface_trace(b, &l->place[v], scaled, &place)) {
      orb_map_surface_at(b, &place, y, x, NULL);
      double energy = orb_map_star_energy(&star, rules, y, x, params->step.shrink) + pull_energy(l, v, y);
      if (energy <= n.energy + (t > 1 ? 0 : params->step.sufficient * t * slope)) {
        put(l, b, v, &place, y, x);
        return t * length;
      }
    }
    t = t > 1 ? 1 : params->step.shorten * t;
  }
  return 0;
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
