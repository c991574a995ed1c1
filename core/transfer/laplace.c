/* Conjugate gradients, preconditioned by the diagonal and the groups' correction (groups.h). */
#include "transfer/laplace.h"

#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "base/parallel.h"

enum { GRAIN = 2048 };          /* vertices a thread takes at a time; the sums, and so the result, depend on it */
enum { MAX_ITERATIONS = 3000 }; /* some hundred are usual; rounding must not keep a job forever */

/* Each of the three right-hand sides has its own step lengths. */
typedef struct solver {
  const orb_edge_graph *graph;
  double *x, *r, *p, *q;
  orb_groups *groups; /* its sums are the correction of the current r */
  double (*sums)[3];  /* per chunk */
  double step[3];
  double beta[3];
} solver;

/* q = L p, and the sums of p·q. */
static void multiply_body(void *arg, int64_t begin, int64_t end, int thread) {
  solver *s = arg;
  const orb_edge_graph *graph = s->graph;
  double sum[3] = {0};
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    double q[3];
    for (int c = 0; c < 3; c++) {
      q[c] = graph->diagonal[v] * s->p[3 * v + c];
    }
    for (int32_t i = graph->first[v]; i < graph->first[v + 1]; i++) {
      const double *p = s->p + 3 * (int64_t)graph->neighbor[i];
      for (int c = 0; c < 3; c++) {
        q[c] -= graph->weight[i] * p[c];
      }
    }
    for (int c = 0; c < 3; c++) {
      s->q[3 * v + c] = q[c];
      sum[c] += q[c] * s->p[3 * v + c];
    }
  }
  memcpy(s->sums[begin / GRAIN], sum, sizeof sum);
}

/* x += step p, r −= step q. */
static void step_body(void *arg, int64_t begin, int64_t end, int thread) {
  solver *s = arg;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    for (int c = 0; c < 3; c++) {
      s->x[3 * v + c] += s->step[c] * s->p[3 * v + c];
      s->r[3 * v + c] -= s->step[c] * s->q[3 * v + c];
    }
  }
}

/* q = the preconditioned r: by the diagonal, and the groups' correction; the sums of r·q. */
static void precondition_body(void *arg, int64_t begin, int64_t end, int thread) {
  solver *s = arg;
  double sum[3] = {0};
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    const double *shift = s->groups->sums + 3 * (int64_t)s->groups->group[v];
    for (int c = 0; c < 3; c++) {
      s->q[3 * v + c] = s->r[3 * v + c] / s->graph->diagonal[v] + shift[c];
      sum[c] += s->q[3 * v + c] * s->r[3 * v + c];
    }
  }
  memcpy(s->sums[begin / GRAIN], sum, sizeof sum);
}

/* p = q + beta p. */
static void direction_body(void *arg, int64_t begin, int64_t end, int thread) {
  solver *s = arg;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    for (int c = 0; c < 3; c++) {
      s->p[3 * v + c] = s->q[3 * v + c] + s->beta[c] * s->p[3 * v + c];
    }
  }
}

static void run(orb_context *ctx, solver *s, orb_loop_fn body, double sums[3]) {
  int64_t chunks = ((int64_t)s->graph->vertex_count + GRAIN - 1) / GRAIN;
  orb_parallel_for(ctx, s->graph->vertex_count, GRAIN, body, s);
  for (int c = 0; c < 3 && sums; c++) {
    sums[c] = 0;
    for (int64_t i = 0; i < chunks; i++) {
      sums[c] += s->sums[i][c];
    }
  }
}

static orb_status solve(orb_context *ctx, solver *s, double limit) {
  double rho[3] = {0}, now[3];
  for (int iteration = 0; iteration < MAX_ITERATIONS; iteration++) {
    ORB_TRY(orb_context_check(ctx));
    orb_groups_solve(s->groups, s->r);
    run(ctx, s, precondition_body, now);
    for (int c = 0; c < 3; c++) {
      s->beta[c] = rho[c] > 0 ? now[c] / rho[c] : 0;
      rho[c] = now[c];
    }
    if (rho[0] <= limit && rho[1] <= limit && rho[2] <= limit) {
      break;
    }
    run(ctx, s, direction_body, NULL);
    run(ctx, s, multiply_body, now);
    for (int c = 0; c < 3; c++) {
      s->step[c] = rho[c] > 0 && now[c] > 0 ? rho[c] / now[c] : 0;
    }
    run(ctx, s, step_body, NULL);
  }
  return ORB_OK;
}

orb_status orb_laplace_solve(orb_context *ctx, const orb_edge_graph *graph, orb_groups *groups, double limit, double *r,
                             double *x) {
  int64_t n = 3 * (int64_t)graph->vertex_count, chunks = ((int64_t)graph->vertex_count + GRAIN - 1) / GRAIN;
  solver s = {.graph = graph, .x = x, .r = r, .groups = groups};
  s.p = ORB_NEW0(ctx, double, n);
  s.q = ORB_NEW(ctx, double, n);
  s.sums = orb_alloc(ctx, (size_t)chunks, sizeof *s.sums);
  orb_status status = s.p && s.q && s.sums ? solve(ctx, &s, limit) : ORB_E_NO_MEMORY;
  orb_free(ctx, s.p);
  orb_free(ctx, s.q);
  orb_free(ctx, s.sums);
  return status;
}
