/* Where landmarks are spread over two shapes that are one body in two poses, the distances from them along the surface
 * say where a place is, as in a survey of land. Wrong landmarks and places that are as far from all of them make single
 * vertices go astray; the registration, which bends the copies little, draws these back. Registered again from
 * there, the trial bends four pairs of people with 8 landmarks 0.8 to 0.9 times as much: as little as the best trial of
 * a search, within 5 %. */
#include "align/find/hinted.h"

#include <math.h>

#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "base/tasks.h"

enum {
  LANES = 4, /* sums of a row that are added side by side: the floats of the vectors that every x86-64 has */
  ROW = ORB_FIND_HINTED_MOST /* distances in a row */
};
_Static_assert((int)ROW % (int)LANES == 0, "lanes end with the row");

/* Distances from the landmarks on both copies: a row for each vertex, 0 where there is no landmark. */
typedef struct plan {
  orb_trials *t;
  int32_t landmarks;
  float *row[2];
} plan;

static orb_status measure(orb_context *ctx, void *arg, int32_t s) {
  plan *p = arg;
  const orb_mesh *mesh = &p->t->copy[s].mesh;
  const size_t n = (size_t)mesh->vertex_count;
  double *from = ORB_NEW(ctx, double, (size_t)p->landmarks *n);
  orb_status status = from ? orb_hint_distances(ctx, &p->t->hint, mesh, s, p->landmarks, from) : ORB_E_NO_MEMORY;
  for (size_t l = 0; l < (size_t)p->landmarks && status == ORB_OK; l++) {
    for (size_t v = 0; v < n; v++) {
      p->row[s][v * ROW + l] = (float)from[l * n + v];
    }
  }
  orb_free(ctx, from);
  return status;
}

/* How much two places differ by their distances from the landmarks. A difference counts relative to the distance, since
 * near landmarks say more, and not squared, since a landmark may be wrong. */
static float unlikeness(const float a[ROW], const float b[ROW], const float weight[ROW]) {
  float sum[LANES] = {0};
  for (int l = 0; l < ROW; l += LANES) {
    for (int k = 0; k < LANES; k++) {
      sum[k] += weight[l + k] * fabsf(a[l + k] - b[l + k]);
    }
  }
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

static orb_status fill(orb_context *ctx, void *arg, int32_t s) {
  const plan *p = arg;
  const int32_t n = p->t->copy[s].mesh.vertex_count, others = p->t->copy[1 - s].mesh.vertex_count;
  int32_t *out = p->t->trial[0].own[s];
  for (int32_t v = 0; v < n; v++) {
    const float *own = p->row[s] + (size_t)v * ROW;
    float weight[ROW] = {0}, least = INFINITY;
    for (int32_t l = 0; l < p->landmarks; l++) {
      weight[l] = 1 / (own[l] + (float)ORB_FIND_HINTED_NEAR);
    }
    out[v] = 0;
    for (int32_t u = 0; u < others; u++) {
      const float differs = unlikeness(own, p->row[1 - s] + (size_t)u * ROW, weight);
      out[v] = differs < least ? u : out[v];
      least = differs < least ? differs : least;
    }
  }
  return orb_context_check(ctx);
}

orb_status orb_trials_make_hinted(orb_trials *t) {
  orb_context *ctx = t->ctx;
  const int32_t most = t->hint.trusted;
  plan p = {.t = t, .landmarks = most < ORB_FIND_HINTED_MOST ? most : ORB_FIND_HINTED_MOST};
  orb_trial *one = &t->trial[t->count++];
  orb_status status;
  ORB_GO(status, orb_trial_create(ctx, t, one), end);
  one->cost = one->rough = 0;
  for (int s = 0; s < 2; s++) {
    p.row[s] = ORB_NEW0(ctx, float, (size_t)t->copy[s].mesh.vertex_count *ROW);
    if (!p.row[s]) {
      status = ORB_E_NO_MEMORY;
      goto end;
    }
  }
  ORB_GO(status, orb_tasks_run(ctx, 2, measure, &p), end);
  status = orb_tasks_run(ctx, 2, fill, &p);
end:
  orb_free(ctx, p.row[0]);
  orb_free(ctx, p.row[1]);
  return status;
}

static orb_status register_one(orb_context *ctx, void *arg, int32_t s) {
  orb_trials *t = arg;
  return orb_trial_register(ctx, t, &t->trial[0], s);
}

/* Registers the trial in both directions, side by side. It is dropped if neither takes the landmarks to their partners:
 * arms that lie against a body are registered to it in one direction, but correctly in the other. */
static orb_status register_both(orb_trials *t, double *bend) {
  orb_trial *one = &t->trial[0];
  ORB_TRY(orb_tasks_run(t->ctx, 2, register_one, t));
  orb_trial_fill_cost(t, one, 2);
  *bend = one->cost < INFINITY ? orb_trials_bend(t) : INFINITY;
  return orb_context_check(t->ctx);
}

/* Registers the trial, and again along the images of its poses, as long as it may be one body. */
static orb_status register_hinted(orb_trials *t, double *bend) {
  orb_trial *one = &t->trial[0];
  ORB_TRY(register_both(t, bend));
  for (int i = 0; i < ORB_FIND_HINTED_AGAIN && *bend <= ORB_FIND_HINTED_UNLIKE; i++) {
    for (int s = 0; s < 2; s++) {
      orb_trial_images(t, one, s, one->own[s]);
    }
    ORB_TRY(register_both(t, bend));
  }
  return ORB_OK;
}

orb_status orb_trials_try_hinted(orb_trials *t, double *bend) {
  *bend = INFINITY;
  if (t->hint.trusted < ORB_FIND_HINTED_LEAST) {
    return ORB_OK;
  }
  ORB_TRY(orb_trials_survey(t, 0));
  ORB_TRY(orb_trials_make_hinted(t));
  ORB_TRY(register_hinted(t, bend));
  if (!(*bend <= ORB_FIND_HINTED_BEND)) {
    orb_trial_free(t->ctx, &t->trial[0]);
    t->count = 0;
    orb_survey_free(t->ctx, &t->survey[0]);
    orb_survey_free(t->ctx, &t->survey[1]);
  }
  return ORB_OK;
}
