#include "elastic/places.h"

#include <math.h>
#include <string.h>

#include "numeric/vec3.h"

/* Lengths are those of surfaces of area 4π. Chosen by trial on the pairs of the half `choose` of
 * tests/bench/correspond.py, unless a line gives another reason. */
static const double AHEAD =
    0.9; /* of the way of the last round: how far ahead a slide looks. 0.7 comes a fiftieth less far */
/* Share of the step by the relief that is taken where a vertex of b pulls one of a, which has its own step. With 0,
 * people stay a fiftieth farther from the truth, and with 1 animals a hundredth. */
static const double BACK_SHARE = 0.5;
static const double FACING = 0.2;     /* least cosine of two normals: with less the place does not pull */
static const double HELD = 0.2;       /* weight that holds such a vertex where it looks from, relative to a pull */
static const double PLANE_MOST = 0.1; /* most that a place slides from a vertex within its tangent plane */

/* The point of the tangent plane of p that is nearest to x, or PLANE_MOST from p on the way to it. */
static void within_plane(const double p[3], const double n[3], const double x[3], double out[3]) {
  double away[3];
  orb_sub(x, p, away);
  double off = orb_dot(away, n), along = sqrt(fmax(0, orb_dot(away, away) - off * off));
  for (int k = 0; k < 3; k++) {
    out[k] = p[k] + (away[k] - off * n[k]) * (along > PLANE_MOST ? PLANE_MOST / along : 1);
  }
}

/* Where the vertices of a look for places. */
static const double *looks_from(const orb_registration *r) {
  return r->ahead ? r->ahead : r->pose->position;
}

static void look_ahead(orb_registration *r) {
  const double *position = r->pose->position;
  for (size_t i = 0; r->ahead && i < 3 * (size_t)r->a.count; i++) {
    r->ahead[i] = position[i] + AHEAD * (position[i] - r->last[i]);
    r->last[i] = position[i];
  }
}

static void find_places(void *arg, int64_t begin, int64_t end, int thread) {
  orb_registration *r = arg;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    r->place[v] = orb_searched_nearest(&r->b.searched, looks_from(r) + 3 * v, r->normal + 3 * v, r->place[v]);
  }
}

static void find_visits(void *arg, int64_t begin, int64_t end, int thread) {
  orb_registration *r = arg;
  (void)thread;
  for (int64_t u = begin; u < end; u++) {
    r->visit[u] = orb_searched_nearest(&r->searched, r->b.mesh->positions + 3 * u, r->b.normal + 3 * u, r->visit[u]);
  }
}

/* Moves the place of vertex v along the surface, to where b stands out as far as a does at v. */
static void follow_relief(const orb_registration *r, int32_t v, double target[3]) {
  const size_t u = 3 * (size_t)r->place[v];
  double from[3], step[3];
  if (r->relief) {
    orb_sub(target, r->b.mesh->positions + u, from);
    orb_relief_step(r->relief[0].height + ORB_RELIEF_SIZES * (size_t)v, r->relief + 1, r->place[v], from,
                    r->b.normal + u, r->noise, step);
    for (int k = 0; k < 3; k++) {
      target[k] += step[k];
    }
  }
}

/* The same for vertex u of b, which pulls vertex v: the place where a stands out as far as b does at u should come to
 * u. Slopes of a are those of the mesh as given, so the step is made there and rotated. */
static void follow_relief_back(const orb_registration *r, int32_t u, int32_t v, const double at[3], double target[3]) {
  double away[3], from[3], step[3];
  if (r->relief) {
    const double *rotation = r->pose->rotation + 9 * (size_t)v, *y = r->b.mesh->positions + 3 * (size_t)u;
    orb_sub(y, at, away);
    const double length = orb_length(away), share = length > PLANE_MOST ? PLANE_MOST / length : 1;
    for (int k = 0; k < 3; k++) {
      from[k] = share * (rotation[k] * away[0] + rotation[3 + k] * away[1] + rotation[6 + k] * away[2]);
    }
    orb_relief_step(r->relief[1].height + ORB_RELIEF_SIZES * (size_t)u, r->relief, v, from, r->a.normal + 3 * (size_t)v,
                    r->noise, step);
    for (int k = 0; k < 3; k++) {
      target[k] -= BACK_SHARE * orb_dot(rotation + 3 * k, step);
    }
  }
}

void orb_pull_by_places(orb_registration *r, double weight) {
  const double *position = looks_from(r);
  double target[3];
  look_ahead(r);
  orb_body_normals(r->a.mesh, position, r->normal, NULL);
  orb_searched_fill(position, r->normal, &r->searched);
  orb_registration_loop(r, r->a.count, find_places);
  orb_registration_loop(r, r->b.count, find_visits);
  r->noise = r->relief ? orb_relief_noise(&r->a, &r->relief[0], &r->relief[1], r->place) : 0;
  for (int32_t v = 0; v < r->a.count; v++) {
    const double *x = position + 3 * (size_t)v, *n = r->normal + 3 * (size_t)v;
    size_t u = 3 * (size_t)r->place[v];
    int faces = orb_dot(n, r->b.normal + u) > FACING;
    within_plane(r->b.mesh->positions + u, r->b.normal + u, x, target);
    follow_relief(r, v, target);
    orb_registration_pull(r, v, faces ? target : x, weight * r->a.mass[v] * (faces ? 1 : HELD));
  }
  for (int32_t u = 0; u < r->b.count; u++) {
    const double *x = r->b.mesh->positions + 3 * (size_t)u, *n = r->b.normal + 3 * (size_t)u;
    int32_t v = r->visit[u];
    if (orb_dot(n, r->normal + 3 * (size_t)v) > FACING) {
      within_plane(x, n, position + 3 * (size_t)v, target);
      follow_relief_back(r, u, v, position + 3 * (size_t)v, target);
      orb_registration_pull(r, v, target, weight * r->b.mass[u]);
    }
  }
}
