/* The edges around a vertex, rotated back, are the edges of the mesh as given under a linear map. That map is fitted to
 * the moments of the edges: Σ q pᵀ (Σ p pᵀ)⁻¹, where p is an edge as given and q the same edge now. The moments are
 * smoothed over the neighbours first. So a stretch that the surroundings share costs nothing, and one that differs from
 * place to place does. Flat surroundings say nothing of their third direction, so some of the mean stretch is added. */
#include "elastic/stretch.h"

#include <string.h>

#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/vec3.h"

enum {
  GRAIN = 128,      /* vertices of one task */
  ROUND_EACH = 600, /* vertices of a mesh for each round of smoothing, which then reaches as far from 2,400 to 24,000
                       vertices. Four times as much is as good */
  ROUNDS_LEAST = 4, /* fewer leave the noise of single triangles */
  ROUNDS_MOST = 40  /* a bound on the time of large meshes; a slide's first mesh hardly has more than 24,000 vertices */
};
/* Weight of the mean stretch against the moments. With less, noise stretches thin limbs; with more, girths cannot
 * change: with 0.2, two people stay a hundredth farther from the truth. */
static const double MEAN_SHARE = 0.1;

typedef struct fitting {
  const orb_body *body;
  const double *position, *rotation; /* now; NULL: as given */
  orb_stretch *stretch;
} fitting;

void orb_stretch_free(orb_context *ctx, orb_stretch *stretch) {
  orb_free(ctx, stretch->linear);
  orb_free(ctx, stretch->given);
  orb_free(ctx, stretch->moment);
  orb_free(ctx, stretch->next);
}

/* Without positions, the edges now are those as given. */
static void gather_range(void *arg, int64_t begin, int64_t end, int thread) {
  const fitting *f = arg;
  const orb_body *body = f->body;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    double *m = f->stretch->moment + 9 * v;
    memset(m, 0, sizeof(double[9]));
    for (int32_t i = body->start[v]; i < body->start[v + 1]; i++) {
      double p[3], now[3], q[3];
      orb_sub(body->mesh->positions + 3 * (size_t)body->next[i], body->mesh->positions + 3 * v, p);
      memcpy(q, p, sizeof q);
      if (f->position) {
        const double *r = f->rotation + 9 * v;
        orb_sub(f->position + 3 * (size_t)body->next[i], f->position + 3 * v, now);
        for (int k = 0; k < 3; k++) {
          q[k] = r[k] * now[0] + r[3 + k] * now[1] + r[6 + k] * now[2];
        }
      }
      orb_add_outer(m, q, p, body->weight[i]);
    }
  }
}

/* One round: the mean of a vertex and its neighbours, by their areas, where a neighbour counts twice, once for each
 * triangle beside the edge. */
static void smooth_range(void *arg, int64_t begin, int64_t end, int thread) {
  const fitting *f = arg;
  const orb_body *body = f->body;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    const double *m = f->stretch->moment;
    double all = body->mass[v], *sum = f->stretch->next + 9 * v;
    for (int k = 0; k < 9; k++) {
      sum[k] = all * m[9 * v + k];
    }
    for (int32_t i = body->start[v]; i < body->start[v + 1]; i++) {
      const double mass = 2 * body->mass[body->next[i]];
      all += mass;
      for (int k = 0; k < 9; k++) {
        sum[k] += mass * m[9 * (int64_t)body->next[i] + k];
      }
    }
    for (int k = 0; k < 9; k++) {
      sum[k] /= all + ORB_TINY; /* triangles may have no area */
    }
  }
}

/* Row-major a b⁻¹ of a symmetric b. Returns 0 where b has no inverse. */
static int divide(const double a[9], const double b[9], double out[9]) {
  double c[9];
  const double det = orb_cofactors(b, c);
  if (!(det > 0)) {
    return 0;
  }
  for (int i = 0; i < 9; i++) {
    out[i] = orb_dot(a + i / 3 * 3, c + i % 3 * 3) / det;
  }
  return 1;
}

static void fit_range(void *arg, int64_t begin, int64_t end, int thread) {
  const fitting *f = arg;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    double now[9], given[9], stretched[9], *linear = f->stretch->linear + 9 * v;
    const double *r = f->rotation + 9 * v;
    memcpy(now, f->stretch->moment + 9 * v, sizeof now);
    memcpy(given, f->stretch->given + 9 * v, sizeof given);
    const double mean_now = MEAN_SHARE * (now[0] + now[4] + now[8]),
                 mean_given = MEAN_SHARE * (given[0] + given[4] + given[8]);
    for (int k = 0; k < 9; k += 4) {
      now[k] += mean_now;
      given[k] += mean_given;
    }
    if (!divide(now, given, stretched)) {
      memcpy(linear, r, sizeof(double[9]));
      continue;
    }
    for (int i = 0; i < 9; i++) {
      linear[i] = 0;
      for (int k = 0; k < 3; k++) {
        linear[i] += r[i / 3 * 3 + k] * stretched[3 * k + i % 3];
      }
    }
  }
}

/* Smooths the moments. */
static void smooth(orb_context *ctx, fitting *f) {
  const int32_t count = f->body->count, wanted = count / ROUND_EACH,
                rounds = wanted < ROUNDS_LEAST  ? ROUNDS_LEAST
                         : wanted > ROUNDS_MOST ? ROUNDS_MOST
                                                : wanted;
  for (int32_t i = 0; i < rounds; i++) {
    orb_parallel_for(ctx, count, GRAIN, smooth_range, f);
    double *moment = f->stretch->moment;
    f->stretch->moment = f->stretch->next;
    f->stretch->next = moment;
  }
}

orb_status orb_stretch_create(orb_context *ctx, const orb_body *body, orb_stretch *out) {
  const size_t n = 9 * (size_t)body->count;
  fitting f = {.body = body, .stretch = out};
  out->linear = ORB_NEW(ctx, double, n);
  out->given = ORB_NEW(ctx, double, n);
  out->moment = ORB_NEW(ctx, double, n);
  out->next = ORB_NEW(ctx, double, n);
  if (!out->linear || !out->given || !out->moment || !out->next) {
    return ORB_E_NO_MEMORY;
  }
  orb_parallel_for(ctx, body->count, GRAIN, gather_range, &f);
  smooth(ctx, &f);
  double *room = out->given;
  out->given = out->moment;
  out->moment = room;
  return ORB_OK;
}

void orb_stretch_fit(orb_context *ctx, const orb_body *body, const double *position, const double *rotation,
                     orb_stretch *stretch) {
  fitting f = {body, position, rotation, stretch};
  orb_parallel_for(ctx, body->count, GRAIN, gather_range, &f);
  smooth(ctx, &f);
  orb_parallel_for(ctx, body->count, GRAIN, fit_range, &f);
}
