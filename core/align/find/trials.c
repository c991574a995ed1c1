#include "align/find/trials.h"

#include <math.h>
#include <string.h>

#include "align/find/evidence.h"
#include "align/find/tips.h"
#include "align/map/engine/surface.h"
#include "align/rotate/correlate.h"
#include "align/rotate/procrustes.h"
#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "base/tasks.h"
#include "elastic/elastic.h"
#include "numeric/vec3.h"
#include "orbmorph/locate.h"

_Static_assert((int)ORB_FIND_RAISED <= (int)ORB_FIND_TIPS, "raised trials and those made of coarse copies have room");

static void scaling_of(const orb_mesh *mesh, orb_trial_scaling *out) {
  orb_extent extent;
  orb_mesh_extent(mesh, &extent);
  out->scale = extent.area > 0 ? sqrt(4 * M_PI / extent.area) : 1;
  for (int k = 0; k < 3; k++) {
    out->middle[k] = 0.5 * extent.min[k] + 0.5 * extent.max[k];
  }
}

/* A decimated copy of shape s, scaled like it. */
static orb_status make_copy(orb_context *ctx, const orb_trials *t, int s, int32_t size, orb_coarse_copy *out) {
  ORB_TRY(orb_coarse_copy_create(ctx, t->mesh[s], size, out));
  for (size_t i = 0; i < 3 * (size_t)out->mesh.vertex_count; i++) {
    out->mesh.positions[i] = (out->mesh.positions[i] - t->scaling[s].middle[i % 3]) * t->scaling[s].scale;
  }
  return ORB_OK;
}

static orb_status make_coarse(orb_context *ctx, void *arg, int32_t s) {
  orb_trials *t = arg;
  scaling_of(t->mesh[s], &t->scaling[s]);
  return make_copy(ctx, t, s, ORB_FIND_COARSE, &t->copy[s]);
}

orb_status orb_trials_open(orb_context *ctx, const orb_mesh *first, const orb_mesh *second, orb_trials *t) {
  t->ctx = ctx;
  t->mesh[0] = first;
  t->mesh[1] = second;
  return orb_tasks_run(ctx, 2, make_coarse, t);
}

static orb_status make_small(orb_context *ctx, void *arg, int32_t s) {
  orb_trials *t = arg;
  t->scaling[s] = (orb_trial_scaling){.scale = 1}; /* a coarse copy is scaled already */
  return make_copy(ctx, t, s, t->small_size > 0 ? t->small_size : ORB_FIND_SMALL, &t->copy[s]);
}

/* The landmarks of the coarse copies, on the small ones. */
static orb_status copy_hint(const orb_trials *coarse, orb_trials *small) {
  const orb_hint_places *from = &coarse->hint;
  const size_t count = 3 * (size_t)from->count;
  double *at[2];
  for (int s = 0; s < 2; s++) {
    at[s] = ORB_NEW(small->ctx, double, count);
    if (at[s]) {
      memcpy(at[s], from->at[s], count * sizeof(double));
    }
  }
  ORB_TRY(orb_hint_places_create(small->ctx, from->count, from->few, from->trusted, at, small->copy, &small->hint));
  small->hint.tells = from->tells;
  return ORB_OK;
}

orb_status orb_trials_open_small(const orb_trials *coarse, orb_trials *small) {
  small->ctx = coarse->ctx;
  small->mesh[0] = &coarse->copy[0].mesh;
  small->mesh[1] = &coarse->copy[1].mesh;
  small->small_size = coarse->small_size;
  ORB_TRY(orb_tasks_run(small->ctx, 2, make_small, small));
  return coarse->hint.count > 0 ? copy_hint(coarse, small) : ORB_OK;
}

static orb_status make_fine(orb_context *ctx, void *arg, int32_t s) {
  orb_trials *t = arg;
  return make_copy(ctx, t, s, t->fine_size, &t->fine[s]);
}

orb_status orb_trials_refine(orb_trials *t, int32_t size) {
  t->fine_size = size;
  return orb_tasks_run(t->ctx, 2, make_fine, t);
}

void orb_trial_pose_free(orb_context *ctx, orb_elastic_pose *pose) {
  orb_free(ctx, pose->position);
  orb_free(ctx, pose->rotation);
  memset(pose, 0, sizeof *pose);
}

orb_status orb_trial_pose_create(orb_context *ctx, const orb_mesh *mesh, orb_elastic_pose *out) {
  out->position = ORB_NEW(ctx, double, 3 * (size_t)mesh->vertex_count);
  out->rotation = ORB_NEW(ctx, double, 9 * (size_t)mesh->vertex_count);
  return out->position && out->rotation ? ORB_OK : ORB_E_NO_MEMORY;
}

void orb_trial_free(orb_context *ctx, orb_trial *one) {
  for (int s = 0; s < 2; s++) {
    orb_trial_pose_free(ctx, &one->pose[s]);
    orb_free(ctx, one->own[s]);
  }
  memset(one, 0, sizeof *one); /* another trial may take its place */
}

orb_status orb_trial_create(orb_context *ctx, const orb_trials *t, orb_trial *out) {
  *out = (orb_trial){.cost = INFINITY, .rough = INFINITY};
  for (int s = 0; s < 2; s++) {
    const orb_mesh *mesh = &t->copy[s].mesh;
    ORB_TRY(orb_trial_pose_create(ctx, mesh, &out->pose[s]));
    out->own[s] = ORB_NEW(ctx, int32_t, mesh->vertex_count);
    if (!out->own[s]) {
      return ORB_E_NO_MEMORY;
    }
  }
  out->map[0] = (orb_rough_map){out->own[0], out->own[1]};
  out->map[1] = (orb_rough_map){out->own[1], out->own[0]};
  return ORB_OK;
}

/* Poses of a trial, both of its maps in both directions. */
static orb_status add_trial(orb_trials *t, const int32_t *forth, const int32_t *back) {
  orb_trial *one = &t->trial[t->count++];
  one->map[0] = (orb_rough_map){forth, back};
  one->map[1] = (orb_rough_map){back, forth};
  for (int s = 0; s < 2; s++) {
    ORB_TRY(orb_trial_pose_create(t->ctx, &t->copy[s].mesh, &one->pose[s]));
  }
  return ORB_OK;
}

static orb_status make_spectral_shape(orb_context *ctx, void *arg, int32_t s) {
  orb_trials *t = arg;
  return orb_spectral_shape_create(ctx, &t->copy[s].mesh, 0, &t->spectral[s]);
}

static orb_status add_spectral(orb_trials *t) {
  orb_spectral_list list;
  ORB_TRY(orb_tasks_run(t->ctx, 2, make_spectral_shape, t));
  ORB_TRY(orb_spectral_find_dense(t->ctx, &t->spectral[0], &t->spectral[1], ORB_FIND_SPECTRAL, &list, &t->dense));
  for (int32_t i = 0; i < list.count; i++) {
    if (list.candidate[i].cost <= list.candidate[0].cost + ORB_FIND_SPECTRAL_BEHIND) {
      ORB_TRY(add_trial(t, t->dense.forth + (size_t)i * (size_t)t->copy[0].mesh.vertex_count,
                        t->dense.back + (size_t)i * (size_t)t->copy[1].mesh.vertex_count));
    }
  }
  return ORB_OK;
}

/* Where each vertex of copy s goes if the sphere of copy 1 is rotated, as vertices of the other copy. */
static orb_status rotated_map(const orb_trials *t, int s, const double rotation[9], int32_t *out) {
  const orb_coarse_copy *from = &t->copy[s], *to = &t->copy[1 - s];
  double r[9];
  orb_locator *locator;
  for (int k = 0; k < 9; k++) {
    r[k] = s ? rotation[k] : rotation[3 * (k % 3) + k / 3];
  }
  ORB_TRY(orb_locator_create(t->ctx, to->points, to->mesh.vertex_count, to->mesh.triangles, to->mesh.triangle_count,
                             NULL, &locator));
  for (int32_t v = 0; v < from->mesh.vertex_count; v++) {
    double p[3];
    orb_place place;
    orb_rotate_point(r, from->points + 3 * (size_t)v, p);
    orb_locate(locator, p, -1, &place);
    out[v] = orb_map_nearest_corner(to->mesh.triangles, &place);
  }
  orb_locator_destroy(t->ctx, locator);
  return ORB_OK;
}

static orb_status add_rotations(orb_trials *t) {
  orb_aligned_shape shape[2];
  double rotation[9 * ORB_FIND_ROTATIONS];
  int32_t count;
  memset(shape, 0, sizeof shape);
  for (int s = 0; s < 2; s++) {
    shape[s].mesh = t->copy[s].mesh;
    shape[s].points = t->copy[s].points;
    t->rotated[s] = ORB_NEW(t->ctx, int32_t, ORB_FIND_ROTATIONS * (size_t)t->copy[s].mesh.vertex_count);
    if (!t->rotated[s]) {
      return ORB_E_NO_MEMORY;
    }
  }
  ORB_TRY(orb_rotation_candidates(t->ctx, &shape[0], &shape[1], ORB_FIND_ROTATIONS, rotation, &count));
  for (int32_t i = 0; i < count; i++) {
    int32_t *map[2];
    for (int s = 0; s < 2; s++) {
      map[s] = t->rotated[s] + (size_t)i * (size_t)t->copy[s].mesh.vertex_count;
      ORB_TRY(rotated_map(t, s, rotation + 9 * (size_t)i, map[s]));
    }
    ORB_TRY(add_trial(t, map[0], map[1]));
  }
  return ORB_OK;
}

/* Fills a map by the vertices of the other sphere that are nearest to where a match of tips takes those of copy s. */
static void carried_map(const orb_trials *t, const orb_tips *const tips[2], const orb_tip_match *match, int s,
                        int32_t *out) {
  const orb_coarse_copy *from = &t->copy[s], *to = &t->copy[1 - s];
  for (int32_t v = 0; v < from->mesh.vertex_count; v++) {
    double p[3], best = -INFINITY;
    out[v] = 0;
    orb_tip_match_carry(tips, match, s, from->points + 3 * (size_t)v, p);
    for (int32_t u = 0; u < to->mesh.vertex_count; u++) {
      const double near = orb_dot(p, to->points + 3 * (size_t)u);
      out[v] = near > best ? u : out[v];
      best = near > best ? near : best;
    }
  }
}

static orb_status add_tips(orb_trials *t) {
  orb_tips tips[2];
  orb_tip_match match[ORB_FIND_TIPS];
  const orb_tips *const both[2] = {&tips[0], &tips[1]};
  for (int s = 0; s < 2; s++) {
    ORB_TRY(orb_tips_find(t->ctx, &t->copy[s], &t->survey[s], &tips[s]));
  }
  const int32_t count = orb_tips_match(&tips[0], &tips[1], ORB_FIND_TIPS, match);
  for (int32_t i = 0; i < count; i++) {
    orb_trial *one = &t->trial[t->count++];
    ORB_TRY(orb_trial_create(t->ctx, t, one));
    one->cost = one->rough = 0;
    for (int s = 0; s < 2; s++) {
      carried_map(t, both, &match[i], s, one->own[s]);
    }
  }
  return orb_context_check(t->ctx);
}

typedef struct surveying {
  orb_trials *t;
  int measured;
} surveying;

static orb_status survey(orb_context *ctx, void *arg, int32_t s) {
  const surveying *all = arg;
  return orb_survey_create(ctx, &all->t->copy[s].mesh, all->measured, &all->t->survey[s]);
}

orb_status orb_trials_survey(orb_trials *t, int measured) {
  surveying all = {t, measured};
  return orb_tasks_run(t->ctx, 2, survey, &all);
}

static orb_status find_symmetry(orb_context *ctx, void *arg, int32_t s) {
  orb_trials *t = arg;
  return orb_symmetry_find(ctx, &t->survey[s], &t->spectral[s], &t->symmetry[s]);
}

orb_status orb_trials_find_symmetries(orb_trials *t) {
  return orb_tasks_run(t->ctx, 2, find_symmetry, t);
}

int orb_trials_are_symmetric(const orb_trials *t) {
  return t->symmetry[0].count > 0 && t->symmetry[1].count > 0;
}

orb_status orb_trials_make(orb_trials *t) {
  ORB_TRY(add_spectral(t));
  ORB_TRY(add_rotations(t));
  return t->survey[0].apart ? add_tips(t) : ORB_OK;
}

orb_status orb_trial_register(orb_context *ctx, const orb_trials *t, orb_trial *one, int s) {
  const orb_mesh *copy = &t->copy[s].mesh, *other = &t->copy[1 - s].mesh;
  const double *pose = one->pose[s].position;
  ORB_TRY(
      orb_elastic_register(ctx, copy, other, &t->survey[s].around, &one->map[s], NULL, &one->pose[s], &one->bend[s]));
  one->resized[s] = orb_evidence_resized(copy, pose);
  one->scattered[s] = orb_evidence_scattered(copy, pose, other, t->survey[1 - s].tree);
  return ORB_OK;
}

orb_status orb_trial_register_both(orb_context *ctx, const orb_trials *t, orb_trial *one) {
  ORB_TRY(orb_trial_register(ctx, t, one, 0));
  return orb_trial_register(ctx, t, one, 1);
}

/* Trials that are registered at once. */
typedef struct registered {
  orb_trials *t;
  int direction;
  int32_t trial[ORB_TRIALS_MAX];
} registered;

static orb_status register_one(orb_context *ctx, void *arg, int32_t i) {
  const registered *all = arg;
  return orb_trial_register(ctx, all->t, &all->t->trial[all->trial[i]], all->direction);
}

/* Registers the trials that are not dropped in one direction, side by side. */
static orb_status register_all(orb_trials *t, int direction) {
  registered all = {.t = t, .direction = direction};
  int32_t count = 0;
  for (int32_t i = 0; i < t->count; i++) {
    if (t->trial[i].cost < INFINITY) {
      all.trial[count++] = i;
    }
  }
  ORB_TRY(orb_context_check(t->ctx));
  ORB_TRY(orb_tasks_run(t->ctx, count, register_one, &all));
  return orb_context_check(t->ctx);
}

void orb_trial_images(const orb_trials *t, const orb_trial *one, int s, int32_t *out) {
  orb_survey_images(&t->survey[1 - s], &t->copy[1 - s].mesh, one->pose[s].position, t->copy[s].mesh.vertex_count, out);
}

/* The mean distance of landmarks from their partners up to which a map keeps them. */
static double most_off(const orb_trials *t) {
  return t->hint.tells ? ORB_FIND_HINT_OFF : ORB_FIND_HINT_OFF_FEW;
}

int orb_trial_keeps_hint(const orb_trials *t, const orb_trial *one, int s) {
  return orb_hint_off(&t->hint, &t->copy[s], s, one->pose[s].position) <= most_off(t);
}

/* What the poses of the first direction or of both cost. */
static double cost_of(const orb_trial *one, int directions) {
  const int last = directions - 1;
  const double bend = (one->bend[0] + one->bend[last]) / 2, resized = fmax(one->resized[0], one->resized[last]),
               scattered = (one->scattered[0] + one->scattered[last]) / 2;
  return pow(bend, ORB_FIND_BEND_POWER) * exp(ORB_FIND_RESIZED_COST * resized + ORB_FIND_SCATTERED_COST * scattered);
}

void orb_trial_fill_cost(const orb_trials *t, orb_trial *one, int directions) {
  const int is_kept = directions == 1 || orb_trial_keeps_hint(t, one, 0) || orb_trial_keeps_hint(t, one, 1);
  const double rotated = orb_evidence_rotated(&t->copy[0].mesh, one->pose[0].position),
               factor = (1 + ORB_FIND_ROTATION_COST * rotated) * (1 + ORB_FIND_ASYMMETRY_COST * one->asymmetry),
               rough = factor * cost_of(one, 1), cost = factor * cost_of(one, directions);
  const int is_known = is_kept && isfinite(rough) && isfinite(cost);
  one->rough = is_known ? rough : INFINITY;
  one->cost = is_known ? cost : INFINITY;
}

/* Dropped trials come last, by their rough cost. */
static int is_before(const orb_trial *x, const orb_trial *y) {
  return x->cost < INFINITY || y->cost < INFINITY ? x->cost < y->cost : x->rough < y->rough;
}

int32_t orb_trials_best(const orb_trials *t) {
  int32_t best = 0;
  for (int32_t i = 1; i < t->count; i++) {
    best = is_before(&t->trial[i], &t->trial[best]) ? i : best;
  }
  return best;
}

double orb_trials_bend(const orb_trials *t) {
  const orb_trial *best = &t->trial[orb_trials_best(t)];
  return (best->bend[0] + best->bend[1]) / 2;
}

int orb_trials_bend_much(const orb_trials *t) {
  return orb_trials_bend(t) > ORB_FIND_EXTENDS;
}

/* Drops the trials whose pose s takes the landmarks elsewhere. */
static void drop_against_hint(orb_trials *t, int s) {
  for (int32_t i = 0; i < t->count; i++) {
    orb_trial *one = &t->trial[i];
    if (one->cost < INFINITY && !orb_trial_keeps_hint(t, one, s)) {
      one->cost = one->rough = INFINITY;
    }
  }
}

/* Does the first pose of a trial take the landmarks to their partners? */
static int any_agrees(const orb_trials *t) {
  int any = 0;
  for (int32_t i = 0; i < t->count; i++) {
    any |= t->trial[i].cost < INFINITY && orb_trial_keeps_hint(t, &t->trial[i], 0);
  }
  return any;
}

/* Costs of the trials that are not dropped, by these directions. */
static void fill_costs(orb_trials *t, int directions) {
  for (int32_t i = 0; i < t->count; i++) {
    if (t->trial[i].cost < INFINITY) {
      orb_trial_fill_cost(t, &t->trial[i], directions);
    }
  }
}

/* The mean distance of the landmarks of copy s from their partners under a rough map. */
static double rough_off(const orb_trials *t, const orb_trial *one, int s) {
  double sum = 0;
  for (int32_t i = 0; i < t->hint.few; i++) {
    const int32_t image = one->map[s].forth[t->hint.vertex[s][i]];
    sum += sqrt(orb_distance2(t->copy[1 - s].mesh.positions + 3 * (size_t)image, t->hint.at[1 - s] + 3 * (size_t)i));
  }
  return t->hint.few > 0 ? sum / t->hint.few : 0;
}

/* Drops the trials whose rough maps leave the landmarks far from their partners in both directions, compared with the
 * best trial: a registration brings them nearer by less than that. */
static void drop_far_from_hint(orb_trials *t) {
  double off[ORB_TRIALS_MAX], least = INFINITY;
  for (int32_t i = 0; i < t->count; i++) {
    off[i] = fmin(rough_off(t, &t->trial[i], 0), rough_off(t, &t->trial[i], 1));
    least = fmin(least, off[i]);
  }
  for (int32_t i = 0; i < t->count; i++) {
    if (off[i] > fmax(most_off(t), ORB_FIND_HINT_ROUGH * least)) {
      t->trial[i].cost = t->trial[i].rough = INFINITY;
    }
  }
}

orb_status orb_trials_rank(orb_trials *t) {
  drop_far_from_hint(t);
  ORB_TRY(register_all(t, 0));
  const int agrees = any_agrees(t);
  if (agrees) {
    drop_against_hint(t, 0);
  }
  fill_costs(t, 1);
  const double most = ORB_FIND_BEHIND * t->trial[orb_trials_best(t)].cost;
  for (int32_t i = 0; i < t->count; i++) {
    orb_trial *one = &t->trial[i];
    one->cost = one->cost > most ? INFINITY : one->cost;
  }
  ORB_TRY(register_all(t, 1));
  fill_costs(t, 2);
  if (!agrees) {
    drop_against_hint(t, 1);
  }
  return ORB_OK;
}

/* The mean distance between the images of the first copy's vertices under two trials, in diagonals. */
static double difference(const orb_trials *t, const orb_trial *x, const orb_trial *y) {
  int32_t n = t->copy[0].mesh.vertex_count;
  orb_extent extent;
  double sum = 0;
  orb_mesh_extent(&t->copy[1].mesh, &extent);
  for (int32_t v = 0; v < n; v++) {
    sum += sqrt(orb_distance2(x->pose[0].position + 3 * (size_t)v, y->pose[0].position + 3 * (size_t)v)) / n;
  }
  return sum / extent.diagonal;
}

/* Whether a trial takes the first copy elsewhere than all trials of the list. */
static int is_different(const orb_trials *t, const orb_trial *one, double apart, const int32_t *list, int32_t count) {
  for (int32_t i = 0; i < count; i++) {
    if (!(difference(t, one, &t->trial[list[i]]) > apart)) {
      return 0;
    }
  }
  return 1;
}

int32_t orb_trials_differing(const orb_trials *t, double apart, int32_t most, int32_t *list) {
  int32_t count = 0, next = orb_trials_best(t);
  next = t->count > 0 && t->trial[next].rough < INFINITY ? next : -1;
  while (next >= 0 && count < most) {
    list[count++] = next;
    next = -1;
    for (int32_t i = 0; i < t->count && count < most; i++) {
      if (t->trial[i].rough < INFINITY && (next < 0 || is_before(&t->trial[i], &t->trial[next])) &&
          is_different(t, &t->trial[i], apart, list, count)) {
        next = i;
      }
    }
  }
  return count;
}

void orb_trials_list(orb_trials *t) {
  t->listed = orb_trials_differing(t, ORB_FIND_DIFFERENT, ORB_TRIALS_LISTED, t->list);
}

orb_status orb_trials_complete(orb_context *ctx, orb_trials *t, int32_t number) {
  ORB_TRY(orb_trial_register(ctx, t, &t->trial[number], 1));
  orb_trial_fill_cost(t, &t->trial[number], 2);
  return ORB_OK;
}

void orb_trials_close(orb_trials *t) {
  for (int32_t i = 0; i < t->count; i++) {
    orb_trial_free(t->ctx, &t->trial[i]);
  }
  for (int s = 0; s < 2; s++) {
    orb_coarse_copy_free(t->ctx, &t->copy[s]);
    orb_coarse_copy_free(t->ctx, &t->fine[s]);
    orb_survey_free(t->ctx, &t->survey[s]);
    orb_spectral_shape_free(t->ctx, &t->spectral[s]);
    orb_symmetry_free(t->ctx, &t->symmetry[s]);
    orb_free(t->ctx, t->rotated[s]);
  }
  orb_hint_places_free(t->ctx, &t->hint);
  orb_free(t->ctx, t->dense.forth);
  orb_free(t->ctx, t->dense.back);
}
