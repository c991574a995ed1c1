#include "align/find/match.h"

#include <math.h>
#include <string.h>

#include "align/find/params.h"
#include "align/map/engine/spread.h"
#include "align/map/engine/surface.h"
#include "align/rotate/correlate.h"
#include "align/rotate/procrustes.h"
#include "align/sheet/copy.h"
#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "elastic/carry.h"
#include "numeric/rotation.h"
#include "numeric/vec3.h"
#include "orbmorph/locate.h"
#include "spectral/spectral.h"

enum { TRIALS = ORB_FIND_SPECTRAL + ORB_FIND_ROTATIONS };

/* A rough map and what registering along it has given. Pose s is of copy s on the other one. */
typedef struct trial {
  orb_rough_map map[2];
  orb_elastic_pose pose[2];
  double bend[2];
  double rough; /* cost in the first direction alone */
  double cost;  /* INFINITY: dropped, because its rough cost is too far behind or landmarks contradict it */
} trial;

/* How a shape is scaled: to area 4π, around the middle of its box. */
typedef struct scaling {
  double middle[3], scale;
} scaling;

typedef struct orb_match_search {
  orb_context *ctx;
  const orb_mesh *mesh[2];
  scaling scaling[2];
  orb_coarse_copy copy[2]; /* scaled */
  orb_hint_places hint;    /* empty: none */
  orb_spectral_dense dense;
  int32_t *rotated[2]; /* the maps of the rotations, one after the other, laid out as in `dense` */
  trial trial[TRIALS];
  int32_t count;
  int32_t list[1 + ORB_MATCH_OTHERS]; /* the best trial and those that differ, in the order of the match */
  int32_t listed;
  /* of the loop that registers */
  int32_t task[2 * TRIALS]; /* 2 · trial + direction */
  orb_status status[2 * TRIALS];
} search;

static void scaling_of(const orb_mesh *mesh, scaling *out) {
  orb_extent extent;
  orb_mesh_extent(mesh, &extent);
  out->scale = extent.area > 0 ? sqrt(4 * M_PI / extent.area) : 1;
  for (int k = 0; k < 3; k++) {
    out->middle[k] = 0.5 * extent.min[k] + 0.5 * extent.max[k];
  }
}

/* A decimated copy of a shape, scaled like it. */
static orb_status copy_create(const search *t, int s, int32_t size, orb_coarse_copy *out) {
  ORB_TRY(orb_coarse_copy_create(t->ctx, t->mesh[s], size, out));
  for (size_t i = 0; i < 3 * (size_t)out->mesh.vertex_count; i++) {
    out->mesh.positions[i] = (out->mesh.positions[i] - t->scaling[s].middle[i % 3]) * t->scaling[s].scale;
  }
  return ORB_OK;
}

static void pose_free(orb_context *ctx, orb_elastic_pose *pose) {
  orb_free(ctx, pose->position);
  orb_free(ctx, pose->rotation);
  memset(pose, 0, sizeof *pose);
}

/* Room for a pose of a copy. */
static orb_status pose_create(orb_context *ctx, const orb_mesh *copy, orb_elastic_pose *out) {
  out->position = ORB_NEW(ctx, double, 3 * (size_t)copy->vertex_count);
  out->rotation = ORB_NEW(ctx, double, 9 * (size_t)copy->vertex_count);
  return out->position && out->rotation ? ORB_OK : ORB_E_NO_MEMORY;
}

/* Poses of a trial, both of its maps in both directions. */
static orb_status add_trial(search *t, const int32_t *forth, const int32_t *back) {
  trial *one = &t->trial[t->count++];
  one->map[0] = (orb_rough_map){forth, back};
  one->map[1] = (orb_rough_map){back, forth};
  for (int s = 0; s < 2; s++) {
    ORB_TRY(pose_create(t->ctx, &t->copy[s].mesh, &one->pose[s]));
  }
  return ORB_OK;
}

static orb_status add_spectral(search *t) {
  orb_spectral_list list;
  ORB_TRY(orb_spectral_find_dense(t->ctx, &t->copy[0].mesh, &t->copy[1].mesh, ORB_FIND_SPECTRAL, &list, &t->dense));
  for (int32_t i = 0; i < list.count && i < ORB_FIND_SPECTRAL; i++) {
    if (list.candidate[i].cost <= list.candidate[0].cost + ORB_FIND_SPECTRAL_BEHIND) {
      ORB_TRY(add_trial(t, t->dense.forth + (size_t)i * (size_t)t->copy[0].mesh.vertex_count,
                        t->dense.back + (size_t)i * (size_t)t->copy[1].mesh.vertex_count));
    }
  }
  return ORB_OK;
}

/* Where each vertex of copy s goes if the sphere of copy 1 is rotated, as vertices of the other copy. */
static orb_status rotated_map(const search *t, int s, const double rotation[9], int32_t *out) {
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

static orb_status add_rotations(search *t) {
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

static void register_tasks(void *arg, int64_t begin, int64_t end, int thread) {
  search *t = arg;
  (void)thread;
  for (int64_t i = begin; i < end; i++) {
    trial *one = &t->trial[t->task[i] / 2];
    int s = t->task[i] % 2;
    t->status[i] = orb_elastic_register(t->ctx, &t->copy[s].mesh, &t->copy[1 - s].mesh, &one->map[s], NULL,
                                        &one->pose[s], &one->bend[s]);
  }
}

/* Registers the trials that are not dropped in one direction, side by side. */
static orb_status register_all(search *t, int direction) {
  int32_t count = 0;
  for (int32_t i = 0; i < t->count; i++) {
    if (t->trial[i].cost < INFINITY) {
      t->task[count++] = 2 * i + direction;
    }
  }
  ORB_TRY(orb_context_check(t->ctx));
  orb_parallel_for(t->ctx, count, 1, register_tasks, t);
  for (int32_t i = 0; i < count; i++) {
    if (t->status[i] != ORB_OK) {
      return t->status[i];
    }
  }
  return orb_context_check(t->ctx);
}

/* The angle of the rotation that carries copy s best onto its pose, over π. */
static double turn_of(const search *t, const trial *one, int s) {
  const orb_mesh *mesh = &t->copy[s].mesh;
  const double *x = mesh->positions, *y = one->pose[s].position;
  double mean[2][3] = {{0}}, h[9] = {0}, r[9];
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    for (int k = 0; k < 3; k++) {
      mean[0][k] += x[3 * (size_t)v + (size_t)k] / mesh->vertex_count;
      mean[1][k] += y[3 * (size_t)v + (size_t)k] / mesh->vertex_count;
    }
  }
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    double p[3], q[3];
    orb_sub(x + 3 * (size_t)v, mean[0], p);
    orb_sub(y + 3 * (size_t)v, mean[1], q);
    orb_add_outer(h, q, p, 1);
  }
  (void)orb_nearest_rotation(h, r);
  return acos(fmin(1, fmax(-1, (r[0] + r[4] + r[8] - 1) / 2))) / M_PI;
}

static void fill_cost(const search *t, trial *one, int directions) {
  double bend = 0;
  for (int s = 0; s < directions; s++) {
    bend += one->bend[s] / directions;
  }
  one->cost = bend * (1 + ORB_FIND_TURN_COST * turn_of(t, one, 0));
}

static int32_t best_of(const search *t) {
  int32_t best = 0;
  for (int32_t i = 1; i < t->count; i++) {
    best = t->trial[i].cost < t->trial[best].cost ? i : best;
  }
  return best;
}

/* Drops the trials whose pose s takes the landmarks elsewhere. */
static void drop_against_hint(search *t, int s) {
  for (int32_t i = 0; i < t->count; i++) {
    trial *one = &t->trial[i];
    if (one->cost < INFINITY && orb_hint_off(&t->hint, &t->copy[s], s, one->pose[s].position) > ORB_FIND_HINT_OFF) {
      one->cost = one->rough = INFINITY;
    }
  }
}

/* Does the first pose of a trial take the landmarks to their partners? */
static int any_agrees(const search *t) {
  int any = 0;
  for (int32_t i = 0; i < t->count; i++) {
    any |= orb_hint_off(&t->hint, &t->copy[0], 0, t->trial[i].pose[0].position) <= ORB_FIND_HINT_OFF;
  }
  return any;
}

/* Costs of the trials that are not dropped, by these directions. */
static void fill_costs(search *t, int directions) {
  for (int32_t i = 0; i < t->count; i++) {
    if (t->trial[i].cost < INFINITY) {
      fill_cost(t, &t->trial[i], directions);
    }
  }
}

/* Registers all trials in one direction, drops those that are too far behind to win, and registers the others in the
 * other direction. Trials that take the landmarks elsewhere are dropped after the first direction. If all do, they are
 * dropped after the second one instead: arms that lie against a body are registered to it in one direction, but
 * correctly in the other. */
static orb_status rank(search *t) {
  ORB_TRY(register_all(t, 0));
  const int agrees = any_agrees(t);
  if (agrees) {
    drop_against_hint(t, 0);
  }
  fill_costs(t, 1);
  const double most = ORB_FIND_BEHIND * t->trial[best_of(t)].cost;
  for (int32_t i = 0; i < t->count; i++) {
    trial *one = &t->trial[i];
    one->rough = one->cost < INFINITY ? one->cost : one->rough;
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
static double difference(const search *t, const trial *x, const trial *y) {
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
static int is_different(const search *t, const trial *one, const int32_t *list, int32_t count) {
  for (int32_t i = 0; i < count; i++) {
    if (!(difference(t, one, &t->trial[list[i]]) > ORB_FIND_DIFFERENT)) {
      return 0;
    }
  }
  return 1;
}

/* Dropped trials come last, by their rough cost. */
static int is_before(const trial *x, const trial *y) {
  return x->cost < INFINITY || y->cost < INFINITY ? x->cost < y->cost : x->rough < y->rough;
}

/* Lists the best trial and, in order, those that differ from it and from each other. */
static void list_different(search *t) {
  t->list[0] = best_of(t);
  t->listed = 1;
  while (t->listed < 1 + ORB_MATCH_OTHERS) {
    int32_t next = -1;
    for (int32_t i = 0; i < t->count; i++) {
      if ((next < 0 || is_before(&t->trial[i], &t->trial[next])) && is_different(t, &t->trial[i], t->list, t->listed)) {
        next = i;
      }
    }
    if (next < 0) {
      break;
    }
    t->list[t->listed++] = next;
  }
}

/* Vertices spread over the first shape, and those nearest to where a trial takes them. */
static orb_status write_pairs(const search *t, const trial *one, orb_match_pairs *out) {
  memset(out, 0, sizeof *out);
  const orb_coarse_copy *copy = t->copy;
  int32_t sample[ORB_MATCH_PAIRS];
  orb_nearest *tree;
  ORB_TRY(orb_map_spread(t->ctx, copy[0].mesh.positions, copy[0].mesh.vertex_count, ORB_MATCH_PAIRS, sample));
  ORB_TRY(
      orb_nearest_create(t->ctx, copy[1].mesh.positions, copy[1].mesh.triangles, copy[1].mesh.triangle_count, &tree));
  for (int i = 0; i < ORB_MATCH_PAIRS; i++) {
    orb_place place;
    (void)orb_nearest_query(tree, one->pose[0].position + 3 * (size_t)sample[i], INFINITY, &place);
    int32_t first = copy[0].vertex[sample[i]];
    int32_t second = copy[1].vertex[orb_map_nearest_corner(copy[1].mesh.triangles, &place)];
    int is_new = 1;
    for (int32_t k = 0; k < out->count; k++) {
      is_new = is_new && out->first[k] != first && out->second[k] != second;
    }
    if (is_new) {
      out->first[out->count] = first;
      out->second[out->count++] = second;
    }
  }
  orb_nearest_destroy(t->ctx, tree);
  return ORB_OK;
}

/* How many times as much another trial bends the shapes: the geometric mean of the ratios of their bends and of their
 * costs. So the rotation in space counts by half: files say which of two sides that look alike is the front, but not
 * that they look different. */
static double lead_over(const trial *best, const trial *other) {
  const int both = other->cost < INFINITY;
  const double bend = both ? (best->bend[0] + best->bend[1]) / 2 : best->bend[0];
  const double more = both ? (other->bend[0] + other->bend[1]) / 2 : other->bend[0];
  const double cost = both ? best->cost : best->rough, dearer = both ? other->cost : other->rough;
  const double most = ORB_FIND_LEAD_MOST;
  return more * dearer < most * most * bend * cost ? sqrt(more / bend * (dearer / cost)) : most;
}

/* Writes the listed trials, without targets. */
static orb_status write_ranking(const search *t, orb_match *out) {
  const trial *best = &t->trial[t->list[0]];
  double cost = 1;
  out->cost = best->cost;
  out->lead = t->listed > 1 ? INFINITY : ORB_FIND_LEAD_ALONE;
  out->bend = (best->bend[0] + best->bend[1]) / 2;
  out->other_count = 0;
  for (int32_t i = 1; i < t->listed; i++) {
    const trial *one = &t->trial[t->list[i]];
    orb_match_other *other = &out->other[out->other_count++];
    cost = fmax(cost, one->cost < INFINITY ? one->cost / best->cost : one->rough / best->rough);
    other->cost = cost;
    out->lead = fmin(out->lead, lead_over(best, one));
    ORB_TRY(write_pairs(t, one, &other->pairs));
  }
  out->clear = t->listed > 1 ? 1 - 1 / out->other[0].cost : ORB_FIND_CLEAR_ALONE;
  return write_pairs(t, best, &out->pairs);
}

/* Registers a trial's second copy again with the landmarks as anchors. Until here landmarks only excluded maps, since
 * anchors would draw a wrong map to their partners as well. If the anchors bend the copy far more than before, they
 * have twisted a limb or the waist; then the pose without them stays until it settles. */
static orb_status draw_to_landmarks(const search *t, trial *one) {
  const orb_mesh *copy = &t->copy[1].mesh;
  orb_elastic_anchor *anchors = NULL;
  orb_elastic_pose drawn = {NULL, NULL};
  double bend;
  orb_status status;
  if (t->hint.count == 0) {
    return ORB_OK;
  }
  ORB_GO(status, orb_hint_anchors_create(t->ctx, &t->hint, copy, &anchors), end);
  ORB_GO(status, pose_create(t->ctx, copy, &drawn), end);
  const orb_elastic_anchors held = {t->hint.count, anchors};
  ORB_GO(status, orb_elastic_register(t->ctx, copy, &t->copy[0].mesh, &one->map[1], &held, &drawn, &bend), end);
  if (bend <= ORB_FIND_DRAWN_BEND * one->bend[1]) {
    const orb_elastic_pose before = one->pose[1];
    one->pose[1] = drawn;
    drawn = before;
  }
end:
  pose_free(t->ctx, &drawn);
  orb_free(t->ctx, anchors);
  return status;
}

/* Settles a finer copy of the second shape on one of the first, and carries its pose to all vertices. */
static orb_status write_targets(const search *t, trial *one, double **target) {
  orb_coarse_copy fine[2] = {{{0}, NULL, NULL}, {{0}, NULL, NULL}};
  orb_elastic_pose pose = {NULL, NULL}, all = {NULL, NULL};
  orb_elastic_anchor *anchors = NULL;
  size_t count = 3 * (size_t)t->mesh[1]->vertex_count;
  double *points = ORB_NEW(t->ctx, double, count);
  orb_status status = ORB_E_NO_MEMORY;
  all.position = *target = ORB_NEW(t->ctx, double, count);
  if (!points || !all.position) {
    goto end;
  }
  for (int s = 0; s < 2; s++) {
    ORB_GO(status, copy_create(t, s, ORB_FIND_FINE, &fine[s]), end);
  }
  ORB_GO(status, pose_create(t->ctx, &fine[1].mesh, &pose), end);
  ORB_GO(status, draw_to_landmarks(t, one), end);
  ORB_GO(status,
         orb_elastic_carry(t->ctx, &t->copy[1].mesh, &one->pose[1], fine[1].mesh.positions, fine[1].mesh.vertex_count,
                           &pose),
         end);
  ORB_GO(status, orb_hint_anchors_create(t->ctx, &t->hint, &fine[1].mesh, &anchors), end);
  const orb_elastic_anchors held = {t->hint.count, anchors};
  ORB_GO(status, orb_elastic_settle(t->ctx, &fine[1].mesh, &fine[0].mesh, &held, &pose), end);
  for (size_t i = 0; i < count; i++) {
    points[i] = (t->mesh[1]->positions[i] - t->scaling[1].middle[i % 3]) * t->scaling[1].scale;
  }
  ORB_GO(status, orb_elastic_carry(t->ctx, &fine[1].mesh, &pose, points, t->mesh[1]->vertex_count, &all), end);
  for (size_t i = 0; i < count; i++) {
    all.position[i] = all.position[i] / t->scaling[0].scale + t->scaling[0].middle[i % 3];
  }
end:
  orb_free(t->ctx, points);
  orb_free(t->ctx, anchors);
  pose_free(t->ctx, &pose);
  for (int s = 0; s < 2; s++) {
    orb_coarse_copy_free(t->ctx, &fine[s]);
  }
  return status;
}

/* Places the landmarks on the copies. *stretch: see orb_hint_stretch(). */
static orb_status take_hint(search *t, const orb_match_hint *hint, double *stretch) {
  double *at[2];
  int32_t count = 0, few = 0;
  for (int s = 0; s < 2; s++) {
    at[s] = ORB_NEW(t->ctx, double, 3 * (size_t)hint->count);
  }
  for (int32_t i = 0; i < hint->count && at[0] && at[1]; i++) {
    const int32_t vertex[2] = {hint->first[i], hint->second[i]};
    if (vertex[0] < 0 || vertex[1] < 0) {
      continue;
    }
    for (int k = 0; k < 6; k++) {
      const int s = k / 3;
      const double x = t->mesh[s]->positions[3 * (size_t)vertex[s] + (size_t)(k % 3)];
      at[s][3 * (size_t)count + (size_t)(k % 3)] = (x - t->scaling[s].middle[k % 3]) * t->scaling[s].scale;
    }
    count++;
    few += i < hint->few;
  }
  ORB_TRY(orb_hint_places_create(t->ctx, count, few, at, t->copy, &t->hint));
  return orb_hint_stretch(t->ctx, &t->hint, t->copy, stretch);
}

/* Does a trial show one body in two poses? If it does not, other starts lead to better maps. */
static int is_one_shape(const trial *one, const orb_match_hint *hint, double stretch) {
  return !hint || stretch <= hint->sure || (one->bend[0] + one->bend[1]) / 2 <= ORB_FIND_HINT_BEND;
}

static orb_status run(search *t, const orb_match_hint *hint, orb_match *out) {
  double stretch = 0;
  for (int s = 0; s < 2; s++) {
    scaling_of(t->mesh[s], &t->scaling[s]);
    ORB_TRY(copy_create(t, s, ORB_FIND_COARSE, &t->copy[s]));
  }
  if (hint) {
    ORB_TRY(take_hint(t, hint, &stretch));
  }
  if (hint && !(stretch <= hint->stretch)) {
    return ORB_OK;
  }
  ORB_TRY(add_spectral(t));
  ORB_TRY(add_rotations(t));
  ORB_TRY(rank(t));
  int32_t best = best_of(t);
  if (t->count == 0 || !(t->trial[best].cost < INFINITY) || !is_one_shape(&t->trial[best], hint, stretch)) {
    return ORB_OK;
  }
  out->is_found = 1;
  list_different(t);
  ORB_TRY(write_ranking(t, out));
  return write_targets(t, &t->trial[best], &out->target);
}

static void search_free(orb_context *ctx, search *t) {
  for (int32_t i = 0; i < t->count; i++) {
    pose_free(ctx, &t->trial[i].pose[0]);
    pose_free(ctx, &t->trial[i].pose[1]);
  }
  for (int s = 0; s < 2; s++) {
    orb_coarse_copy_free(ctx, &t->copy[s]);
    orb_free(ctx, t->rotated[s]);
  }
  orb_hint_places_free(ctx, &t->hint);
  orb_free(ctx, t->dense.forth);
  orb_free(ctx, t->dense.back);
  orb_free(ctx, t);
}

orb_status orb_match_find(orb_context *ctx, const orb_mesh *first, const orb_mesh *second, const orb_match_hint *hint,
                          orb_match *out) {
  memset(out, 0, sizeof *out);
  search *t = out->search = ORB_NEW0(ctx, search, 1);
  if (!t) {
    return ORB_E_NO_MEMORY;
  }
  t->ctx = ctx;
  t->mesh[0] = first;
  t->mesh[1] = second;
  return run(t, hint, out);
}

orb_status orb_match_other_target(orb_context *ctx, const orb_match *match, int32_t k, double **target) {
  search *t = match->search;
  trial *one = &t->trial[t->list[1 + k]];
  ORB_ASSERT(k < match->other_count && t->ctx == ctx);
  *target = NULL;
  if (!(one->cost < INFINITY)) { /* it was dropped before its way back was registered */
    t->task[0] = 2 * t->list[1 + k] + 1;
    register_tasks(t, 0, 1, 0);
    ORB_TRY(t->status[0]);
    fill_cost(t, one, 2);
  }
  return write_targets(t, one, target);
}

orb_status orb_match_choose(orb_context *ctx, orb_match *match, int32_t k, double *target, double clear) {
  search *t = match->search;
  const int32_t chosen = t->list[1 + k];
  ORB_ASSERT(k < match->other_count && t->trial[chosen].cost < INFINITY);
  memmove(t->list + 1, t->list, (size_t)(1 + k) * sizeof *t->list);
  t->list[0] = chosen;
  orb_free(ctx, match->target);
  match->target = target;
  ORB_TRY(write_ranking(t, match));
  match->clear = clear;
  match->lead = 1;
  return ORB_OK;
}

void orb_match_free(orb_context *ctx, orb_match *match) {
  if (match->search) {
    search_free(ctx, match->search);
  }
  orb_free(ctx, match->target);
  memset(match, 0, sizeof *match);
}

double orb_match_confidence(double bend, double clear, double lead, double energy) {
  if (!(energy >= 1) || !isfinite(energy)) { /* rounding of an isometry, or not measured: as if the map were bad */
    energy = energy < 1 ? 1 : ORB_FIND_SURE_UNMEASURED;
  }
  double odds = ORB_FIND_SURE + ORB_FIND_SURE_CLEAR * fmin(clear, ORB_FIND_CLEAR) - ORB_FIND_SURE_BEND * bend -
                ORB_FIND_SURE_ENERGY * log(energy);
  const double share = 1 / (1 + exp(-(lead - 1) / ORB_FIND_TIE));
  return share / (1 + exp(-odds));
}
