#include "align/find/mirrored.h"

#include <math.h>
#include <string.h>

#include "align/find/agreed.h"
#include "base/check.h"
#include "base/memory.h"
#include "base/tasks.h"

/* Where a trial takes the vertices of both copies, and which symmetries it keeps best. */
typedef struct images {
  orb_context *ctx;
  int32_t *of[2];
  const int32_t *mirror[2]; /* mirror images of the vertices of each copy */
  double asymmetry;
} images;

static void images_free(images *m) {
  orb_free(m->ctx, m->of[0]);
  orb_free(m->ctx, m->of[1]);
}

/* The mean distance between the mirror image of an image and the image of the mirror image. */
static double off_of(const orb_trials *t, const images *m, int s, const int32_t *own, const int32_t *other) {
  const int32_t n = t->copy[s].mesh.vertex_count, *image = m->of[s];
  double sum = 0;
  for (int32_t v = 0; v < n; v++) {
    sum += orb_survey_apart(&t->survey[1 - s], &t->copy[1 - s].mesh, image[own[v]], other[image[v]]) / n;
  }
  return sum;
}

/* Fills m for where the vertices of small copies lie under a trial, in one direction or both. Free it in any case. */
static orb_status images_create(orb_context *ctx, const orb_trials *small, const double *const position[2],
                                int directions, images *m) {
  *m = (images){.ctx = ctx, .asymmetry = INFINITY};
  for (int s = 0; s < directions; s++) {
    const int32_t n = small->copy[s].mesh.vertex_count;
    m->of[s] = ORB_NEW(ctx, int32_t, n);
    if (!m->of[s]) {
      return ORB_E_NO_MEMORY;
    }
    orb_survey_images(&small->survey[1 - s], &small->copy[1 - s].mesh, position[s], n, m->of[s]);
  }
  for (int i = 0; i < small->symmetry[0].count; i++) {
    for (int k = 0; k < small->symmetry[1].count; k++) {
      const int32_t *first = small->symmetry[0].image[i], *second = small->symmetry[1].image[k];
      double off = off_of(small, m, 0, first, second);
      if (directions == 2) {
        off = (off + off_of(small, m, 1, second, first)) / 2;
      }
      if (off < m->asymmetry) {
        m->asymmetry = off;
        m->mirror[0] = first;
        m->mirror[1] = second;
      }
    }
  }
  return orb_context_check(ctx);
}

/* Sets the asymmetry of a trial of t by where it takes the vertices of small copies, and its costs. */
static orb_status weigh_trial(orb_context *ctx, const orb_trials *small, const double *const position[2],
                              int directions, const orb_trials *t, orb_trial *one) {
  images m;
  orb_status status;
  ORB_GO(status, images_create(ctx, small, position, directions, &m), end);
  one->asymmetry = m.asymmetry;
  orb_trial_fill_cost(t, one, directions);
end:
  images_free(&m);
  return status;
}

/* Trials that are weighed side by side. */
typedef struct weighing {
  const orb_trials *small;
  orb_trials *t;
} weighing;

static orb_status weigh(orb_context *ctx, void *arg, int32_t i) {
  const weighing *all = arg;
  orb_trial *one = &all->t->trial[i];
  double *position[2] = {NULL, NULL};
  orb_status status = ORB_OK;
  const int is_dropped = !(one->cost < INFINITY), directions = is_dropped ? 1 : 2;
  if (!(one->rough < INFINITY)) {
    return ORB_OK; /* its poses may not be set */
  }
  for (int s = 0; s < directions; s++) {
    const orb_coarse_copy *copy = &all->small->copy[s];
    position[s] = ORB_NEW(ctx, double, 3 * (size_t)copy->mesh.vertex_count);
    if (!position[s]) {
      status = ORB_E_NO_MEMORY;
      goto end;
    }
    for (int32_t v = 0; v < copy->mesh.vertex_count; v++) {
      const int32_t at = all->t == all->small ? v : copy->vertex[v];
      memcpy(position[s] + 3 * (size_t)v, one->pose[s].position + 3 * (size_t)at, 3 * sizeof(double));
    }
  }
  const double *const held[2] = {position[0], position[1]};
  status = weigh_trial(ctx, all->small, held, directions, all->t, one);
  one->cost = is_dropped ? INFINITY : one->cost;
end:
  orb_free(ctx, position[0]);
  orb_free(ctx, position[1]);
  return status;
}

orb_status orb_trials_weigh_asymmetry(const orb_trials *small, orb_trials *t) {
  weighing all = {small, t};
  return orb_trials_are_symmetric(small) ? orb_tasks_run(t->ctx, t->count, weigh, &all) : ORB_OK;
}

/* Is vertex v on the side of vertex `on`? Every point of that side is nearer to it than to its mirror image: a way from
 * there crosses the middle, which is as far from both. */
static int is_beside(const orb_trials *t, int s, const int32_t *mirror, int32_t on, int32_t v) {
  const orb_mesh *mesh = &t->copy[s].mesh;
  return orb_survey_apart(&t->survey[s], mesh, v, on) <= orb_survey_apart(&t->survey[s], mesh, v, mirror[on]);
}

/* The vertex farthest from its mirror image. */
static int32_t outermost(const orb_trials *t, int s, const int32_t *mirror) {
  int32_t far = 0;
  double most = -1;
  for (int32_t v = 0; v < t->copy[s].mesh.vertex_count; v++) {
    const double apart = orb_survey_apart(&t->survey[s], &t->copy[s].mesh, v, mirror[v]);
    far = apart > most ? v : far;
    most = apart > most ? apart : most;
  }
  return far;
}

/* One vertex of each copy on the same side: the outermost ones, or the mirror image of the second one. The trial takes
 * most of the one side to the other. */
static void choose_sides(const orb_trials *t, const images *m, int32_t on[2]) {
  int64_t votes = 0;
  on[0] = outermost(t, 0, m->mirror[0]);
  on[1] = outermost(t, 1, m->mirror[1]);
  for (int32_t v = 0; v < t->copy[0].mesh.vertex_count; v++) {
    votes += is_beside(t, 0, m->mirror[0], on[0], v) == is_beside(t, 1, m->mirror[1], on[1], m->of[0][v]) ? 1 : -1;
  }
  on[1] = votes < 0 ? m->mirror[1][on[1]] : on[1];
}

/* Fills maps, and positions by them, that are the trial's on one side and the mirror images of that on the other. Side
 * 0 is that of the vertices `on`. */
static void fill_maps(const orb_trials *t, const images *m, int side, orb_trial *out) {
  int32_t on[2];
  choose_sides(t, m, on);
  for (int s = 0; s < 2; s++) {
    const int32_t *own = m->mirror[s], *other = m->mirror[1 - s], *image = m->of[s];
    for (int32_t v = 0; v < t->copy[s].mesh.vertex_count; v++) {
      const int is_kept = is_beside(t, s, own, on[s], v) == (side == 0);
      out->own[s][v] = is_kept ? image[v] : other[image[own[v]]];
      memcpy(out->pose[s].position + 3 * (size_t)v, t->copy[1 - s].mesh.positions + 3 * (size_t)out->own[s][v],
             3 * sizeof(double));
    }
  }
}

/* Mirrors a trial from one side to the other, extends what agrees, and registers it. A part in the middle that has gone
 * to one side is torn; it does not come back to itself, so it does not count as agreed. */
static orb_status mirror(orb_context *ctx, const orb_trials *t, const orb_trial *from, int side, orb_trial *out) {
  const orb_mesh *const mesh[2] = {&t->copy[0].mesh, &t->copy[1].mesh};
  const orb_survey *const survey[2] = {&t->survey[0], &t->survey[1]};
  orb_agreed agreed = {0};
  images m;
  int extended;
  orb_status status;
  const double *const before[2] = {from->pose[0].position, from->pose[1].position};
  ORB_GO(status, images_create(ctx, t, before, 2, &m), end);
  ORB_GO(status, orb_agreed_create(ctx, mesh, survey, &agreed), end);
  ORB_GO(status, orb_trial_create(ctx, t, out), end);
  fill_maps(t, &m, side, out);
  const double *const position[2] = {out->pose[0].position, out->pose[1].position};
  /* where nothing is extended, the maps stay as filled */
  ORB_GO(status, orb_agreed_extend(ctx, &agreed, position, 1, out->own[0], out->own[1], &extended), end);
  ORB_GO(status, orb_trial_register_both(ctx, t, out), end);
  status = weigh_trial(ctx, t, position, 2, t, out);
end:
  images_free(&m);
  orb_agreed_free(ctx, &agreed);
  return status;
}

/* Trials that are mirrored side by side. */
typedef struct mirroring {
  const orb_trials *t;
  int32_t list[ORB_FIND_MIRRORED];
  orb_trial made[2 * ORB_FIND_MIRRORED]; /* of each, from one side and from the other */
} mirroring;

static orb_status mirror_one(orb_context *ctx, void *arg, int32_t i) {
  mirroring *all = arg;
  return mirror(ctx, all->t, &all->t->trial[all->list[i / 2]], i % 2, &all->made[i]);
}

/* The best trials that differ and are not dropped. */
static int32_t list_best(const orb_trials *t, int32_t *list) {
  const int32_t count = orb_trials_differing(t, ORB_FIND_RAISED_APART, ORB_FIND_MIRRORED, list);
  int32_t kept = 0;
  while (kept < count && t->trial[list[kept]].cost < INFINITY) {
    kept++;
  }
  return kept;
}

orb_status orb_trials_mirror(orb_trials *t) {
  mirroring all = {.t = t};
  if (!orb_trials_are_symmetric(t)) {
    return ORB_OK;
  }
  const int32_t count = 2 * list_best(t, all.list);
  const orb_status status = orb_tasks_run(t->ctx, count, mirror_one, &all);
  for (int32_t i = 0; i < count; i++) {
    orb_trial *one = &t->trial[all.list[i / 2]];
    const int is_better = status == ORB_OK && all.made[i].cost < one->cost;
    orb_trial_free(t->ctx, is_better ? one : &all.made[i]);
    if (is_better) {
      *one = all.made[i];
    }
  }
  return status;
}
