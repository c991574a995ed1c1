#include "elastic/registration.h"

#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "base/tasks.h"
#include "numeric/rotation.h"
#include "numeric/vec3.h"

enum { GRAIN = 128 };                      /* vertices of one task */
static const double ANCHORED = 10;         /* pull of an anchor, relative to the edges of its vertex */
static const double LEAST_DIAGONAL = 1e-9; /* keeps the matrix regular where nothing pulls */

void orb_registration_loop(orb_registration *r, int32_t count, orb_loop_fn body) {
  if (r->is_alone) {
    orb_parallel_for(r->ctx, count, GRAIN, body, r);
  } else {
    body(r, 0, count, 0);
  }
}

/* The covariance of the edges at v, as given and now. */
static void add_covariance(const orb_registration *r, int32_t v, double h[9]) {
  const orb_body *a = &r->a;
  for (int32_t i = a->start[v]; i < a->start[v + 1]; i++) {
    double p[3], q[3];
    orb_sub(a->mesh->positions + 3 * (size_t)a->next[i], a->mesh->positions + 3 * (size_t)v, p);
    orb_sub(r->pose->position + 3 * (size_t)a->next[i], r->pose->position + 3 * (size_t)v, q);
    orb_add_outer(h, q, p, a->weight[i]);
  }
}

static void fit_range(void *arg, int64_t begin, int64_t end, int thread) {
  orb_registration *r = arg;
  (void)thread;
  for (int64_t first = begin; first < end; first += ORB_ROTATIONS) {
    const int count = end - first < ORB_ROTATIONS ? (int)(end - first) : ORB_ROTATIONS;
    double h[9][ORB_ROTATIONS] = {{0}};
    for (int l = 0; l < count; l++) {
      double one[9] = {0};
      add_covariance(r, (int32_t)first + l, one);
      for (int k = 0; k < 9; k++) {
        h[k][l] = one[k];
      }
    }
    orb_nearest_rotations(h, count, r->pose->rotation + 9 * first);
  }
}

void orb_registration_fit(orb_registration *r) {
  orb_registration_loop(r, r->a.count, fit_range);
  if (r->stretch) {
    orb_stretch_fit(r->ctx, &r->a, r->pose->position, r->pose->rotation, r->stretch);
  }
}

/* Sums, over the edges that arrive at v, what the surroundings of both ends make of each given edge. */
static void add_edges(const orb_registration *r, int32_t v, double sum[3]) {
  const orb_body *a = &r->a;
  const double *linear = r->stretch ? r->stretch->linear : r->pose->rotation, *here = linear + 9 * (size_t)v;
  for (int32_t i = a->start[v]; i < a->start[v + 1]; i++) {
    const double *there = linear + 9 * (size_t)a->next[i];
    double e[3];
    orb_sub(a->mesh->positions + 3 * (size_t)v, a->mesh->positions + 3 * (size_t)a->next[i], e);
    for (int k = 0; k < 3; k++) {
      sum[k] += a->weight[i] / 2 * (orb_dot(here + 3 * k, e) + orb_dot(there + 3 * k, e));
    }
  }
}

static void fill_system(void *arg, int64_t begin, int64_t end, int thread) {
  orb_registration *r = arg;
  const orb_body *a = &r->a;
  (void)thread;
  for (int32_t v = (int32_t)begin; v < end; v++) {
    double *right = r->right + 3 * (size_t)v;
    memcpy(right, r->target + 3 * (size_t)v, sizeof(double[3]));
    add_edges(r, v, right);
    r->diagonal[v] = r->pull[v] + LEAST_DIAGONAL;
    for (int32_t i = a->start[v]; i < a->start[v + 1]; i++) {
      r->diagonal[v] += a->weight[i];
    }
  }
}

orb_status orb_registration_solve(orb_registration *r, int again) {
  orb_registration_loop(r, r->a.count, fill_system);
  if (again) {
    ORB_TRY(orb_factor_compute(r->factor, r->diagonal));
  }
  orb_factor_solve3(r->factor, r->right, r->pose->position);
  return ORB_OK;
}

void orb_registration_clear(orb_registration *r) {
  memset(r->pull, 0, (size_t)r->a.count * sizeof *r->pull);
  memset(r->target, 0, 3 * (size_t)r->a.count * sizeof *r->target);
}

void orb_registration_pull(orb_registration *r, int32_t v, const double target[3], double weight) {
  r->pull[v] += weight;
  for (int k = 0; k < 3; k++) {
    r->target[3 * (size_t)v + (size_t)k] += weight * target[k];
  }
}

/* The point beside the vertex rotates with the vertex's surroundings. */
void orb_registration_pull_by_anchors(orb_registration *r) {
  for (int32_t i = 0; r->anchors && i < r->anchors->count; i++) {
    const orb_elastic_anchor *one = &r->anchors->one[i];
    const double *rotation = r->pose->rotation + 9 * (size_t)one->vertex;
    double target[3], edges = 0;
    for (int k = 0; k < 3; k++) {
      target[k] = one->place[k] - orb_dot(rotation + 3 * k, one->offset);
    }
    for (int32_t e = r->a.start[one->vertex]; e < r->a.start[one->vertex + 1]; e++) {
      edges += r->a.weight[e];
    }
    orb_registration_pull(r, one->vertex, target, ANCHORED * edges);
  }
}

/* Adds up the squared changes of the edges of v, and their squared lengths. */
static void add_bend(const orb_registration *r, int32_t v, double *bend, double *length) {
  const orb_body *a = &r->a;
  const double *rotation = r->pose->rotation + 9 * (size_t)v;
  for (int32_t i = a->start[v]; i < a->start[v + 1]; i++) {
    double p[3], q[3];
    orb_sub(a->mesh->positions + 3 * (size_t)a->next[i], a->mesh->positions + 3 * (size_t)v, p);
    orb_sub(r->pose->position + 3 * (size_t)a->next[i], r->pose->position + 3 * (size_t)v, q);
    for (int k = 0; k < 3; k++) {
      double d = q[k] - orb_dot(rotation + 3 * k, p);
      *bend += a->weight[i] * d * d;
    }
    *length += a->weight[i] * orb_dot(p, p);
  }
}

double orb_registration_bend_at(const orb_registration *r, int32_t v) {
  double bend = 0, length = 0;
  add_bend(r, v, &bend, &length);
  return length > 0 ? bend / length : 0;
}

double orb_registration_bend(const orb_registration *r) {
  double bend = 0, length = 0;
  for (int32_t v = 0; v < r->a.count; v++) {
    add_bend(r, v, &bend, &length);
  }
  return length > 0 ? bend / length : 0;
}

void orb_registration_free(orb_registration *r) {
  orb_factor_destroy(r->ctx, r->factor);
  orb_body_free(r->ctx, &r->a);
  orb_body_free(r->ctx, &r->b);
  orb_free(r->ctx, r->normal);
  orb_free(r->ctx, r->ahead);
  orb_free(r->ctx, r->last);
  orb_searched_free(r->ctx, &r->searched);
  orb_free(r->ctx, r->diagonal);
  orb_free(r->ctx, r->right);
  orb_free(r->ctx, r->pull);
  orb_free(r->ctx, r->target);
  orb_free(r->ctx, r->place);
  orb_free(r->ctx, r->visit);
}

static orb_status factor_create(orb_context *ctx, orb_registration *r) {
  const orb_body *a = &r->a;
  int64_t count = 0;
  orb_coupling *couplings = ORB_NEW(ctx, orb_coupling, 3 * (size_t)a->mesh->triangle_count);
  if (!couplings) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t v = 0; v < a->count; v++) {
    for (int32_t i = a->start[v]; i < a->start[v + 1]; i++) {
      if (a->next[i] > v) {
        couplings[count++] = (orb_coupling){v, a->next[i], -a->weight[i]};
      }
    }
  }
  orb_status status = orb_factor_create(ctx, a->count, couplings, count, &r->factor);
  orb_free(ctx, couplings);
  return status;
}

/* What the two meshes need, each for itself. */
typedef struct meshes {
  orb_registration *r;
  const orb_mesh *mesh[2];
} meshes;

static orb_status create_body(orb_context *ctx, void *arg, int32_t s) {
  const meshes *m = arg;
  orb_registration *r = m->r;
  ORB_TRY(orb_body_create(ctx, m->mesh[s], s == 0 ? &r->a : &r->b));
  if (s == 1) {
    return ORB_OK;
  }
  ORB_TRY(orb_searched_create(ctx, m->mesh[0]->positions, r->a.normal, r->a.count, &r->searched));
  return factor_create(ctx, r);
}

orb_status orb_registration_create(orb_context *ctx, const orb_mesh *a, const orb_mesh *b, orb_registration *r) {
  const size_t n = (size_t)a->vertex_count;
  meshes both = {r, {a, b}};
  if (r->is_alone) {
    ORB_TRY(orb_tasks_run(ctx, 2, create_body, &both));
  } else {
    ORB_TRY(create_body(ctx, &both, 0));
    ORB_TRY(create_body(ctx, &both, 1));
  }
  r->normal = ORB_NEW(ctx, double, 3 * n);
  r->diagonal = ORB_NEW(ctx, double, n);
  r->right = ORB_NEW(ctx, double, 3 * n);
  r->pull = ORB_NEW(ctx, double, n);
  r->target = ORB_NEW(ctx, double, 3 * n);
  r->place = ORB_NEW(ctx, int32_t, n);
  r->visit = ORB_NEW(ctx, int32_t, b->vertex_count);
  if (!r->normal || !r->diagonal || !r->right || !r->pull || !r->target || !r->place || !r->visit) {
    return ORB_E_NO_MEMORY;
  }
  memset(r->place, -1, n * sizeof *r->place); /* no hints for the first round */
  memset(r->visit, -1, (size_t)b->vertex_count * sizeof *r->visit);
  return ORB_OK;
}
