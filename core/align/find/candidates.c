/* Alignment without landmarks: the search for the best candidate.
 *
 * A shape that is nearly symmetric, or whose limbs are alike, can be matched with another shape in many ways, and the
 * best correlation of whole spheres may be a wrong one. So both shapes are decimated to about a thousand vertices, and
 * candidates are tried there: rotations that correlate well and differ, the likeliest tip maps (tip_maps.h,
 * tip_rotations.h), and spectral maps (spectral), each walked to its common targets as in pin. If a spectral
 * map stands out among its kind, it is right, whatever its energy: then only candidates that agree with it count. A map
 * that only a reflection could produce folds the sphere over itself on the way, and gets stuck or costs much. The
 * energy after a walk says little, since right maps and wrong ones cost alike; but some sweeps of the energy of the
 * composed map separate them, and take no longer than the walk. The best candidates that differ are composed in full,
 * and their energy decides. Symmetric shapes have several candidates of nearly the same energy: then the smaller
 * rotation in space wins, since most shapes stand upright and face one way.
 */
#include "align/find/candidates.h"

#include <math.h>
#include <string.h>

#include "align/find/params.h"
#include "align/find/tip_choice.h"
#include "align/find/tip_rotations.h"
#include "align/find/tips.h"
#include "align/map/compose.h"
#include "align/map/engine/spread.h"
#include "align/map/engine/surface.h"
#include "align/pin/walk.h"
#include "align/rotate/correlate.h"
#include "align/rotate/procrustes.h"
#include "align/rotate/rotate.h"
#include "align/sheet/copy.h"
#include "base/check.h"
#include "base/memory.h"
#include "numeric/dense.h"
#include "numeric/vec3.h"
#include "orbmorph/remesh.h"
#include "spectral/spectral.h"

/* A candidate on the coarse copies. */
typedef struct candidate {
  int32_t count; /* tips; 0: a rotation */
  int is_given;  /* the rotation that the spheres get without this search */
  int is_near;   /* its pairs are only near each other, as those of a spectral map; tips are exact */
  int is_stuck;  /* composing it in full did not improve it */
  double rotation[9];
  int32_t first[ORB_TIPS_MAX], second[ORB_TIPS_MAX];
  double energy, cost; /* the cost ranks candidates: (energy − 1) · (1 + ORB_FIND_ROTATION_COST · angle / π) */
  double image[ORB_FIND_SAMPLES][3]; /* where the samples of the first shape go */
} candidate;

typedef struct search {
  orb_context *ctx;
  orb_coarse_copy shape[2];
  int32_t sample[ORB_FIND_SAMPLES];
  candidate list[ORB_FIND_ROTATIONS + ORB_FIND_TIP_MAPS + ORB_TIP_ROTATIONS + 2 * ORB_FIND_SPECTRAL];
  orb_spectral_list spectral;
  int32_t rotations, count; /* rotations come first, then tip maps, then spectral maps */
} search;

/* Makes sheets of the coarse copies and aligns them by the candidate. *held 0: its pairs cannot be met. */
static orb_status carry(search *t, const candidate *one, orb_sheet *sheets, int *held) {
  static const int32_t numbers[ORB_TIPS_MAX] = {0, 1, 2, 3, 4, 5, 6, 7};
  *held = 1;
  for (int s = 0; s < 2; s++) {
    const int32_t *vertices = s ? one->second : one->first;
    ORB_TRY(orb_sheet_create(t->ctx, &t->shape[s].mesh, t->shape[s].points, &sheets[s]));
    if (one->count) {
      sheets[s].shape.landmark_vertices = ORB_NEW(t->ctx, int32_t, one->count);
      if (!sheets[s].shape.landmark_vertices) {
        return ORB_E_NO_MEMORY;
      }
      memcpy(sheets[s].shape.landmark_vertices, vertices, (size_t)one->count * sizeof *vertices);
      sheets[s].landmark_count = one->count;
    }
  }
  if (!one->count) {
    return orb_sheet_rotate(t->ctx, &sheets[1], one->rotation);
  }
  int stuck;
  ORB_TRY(orb_pin_walk(t->ctx, sheets, 2, numbers, one->count, ORB_PRESET_FAST, ORB_FIND_WALK, NULL, &stuck));
  *held = !stuck;
  return ORB_OK;
}

static orb_status sample_images(const search *t, const orb_sheet *sheets, candidate *one) {
  const orb_aligned_shape *a = &sheets[0].shape, *b = &sheets[1].shape;
  orb_locator *locator;
  ORB_TRY(orb_locator_create(t->ctx, b->points, b->mesh.vertex_count, b->mesh.triangles, b->mesh.triangle_count, NULL,
                             &locator));
  for (int i = 0; i < ORB_FIND_SAMPLES; i++) {
    orb_place place;
    orb_locate(locator, a->points + 3 * (size_t)t->sample[i], -1, &place);
    orb_place_position(&b->mesh, &place, one->image[i]);
  }
  orb_locator_destroy(t->ctx, locator);
  return ORB_OK;
}

/* The angle of the rotation in space that carries the samples best onto their images, over π. */
static orb_status rotation_angle(const search *t, const candidate *one, double *angle) {
  double mean[2][3] = {{0}}, c[9] = {0}, r[9];
  const double *x = t->shape[0].mesh.positions;
  for (int i = 0; i < ORB_FIND_SAMPLES; i++) {
    for (int k = 0; k < 3; k++) {
      mean[0][k] += x[3 * (size_t)t->sample[i] + (size_t)k] / ORB_FIND_SAMPLES;
      mean[1][k] += one->image[i][k] / ORB_FIND_SAMPLES;
    }
  }
  for (int i = 0; i < ORB_FIND_SAMPLES; i++) {
    double p[3], q[3];
    orb_sub(x + 3 * (size_t)t->sample[i], mean[0], p);
    orb_sub(one->image[i], mean[1], q);
    orb_add_outer(c, p, q, 1);
  }
  ORB_TRY(orb_procrustes_covariance(t->ctx, c, r, NULL));
  *angle = acos(fmin(1, fmax(-1, (r[0] + r[4] + r[8] - 1) / 2))) / M_PI;
  return ORB_OK;
}

/* How far a candidate takes the samples from where the first spectral map does, judged by its nearest pairs. */
static double away_from_first(const search *t, const candidate *one) {
  const orb_spectral_candidate *map = &t->spectral.candidate[0];
  const double *x = t->shape[0].mesh.positions, *y = t->shape[1].mesh.positions;
  orb_extent extent[2];
  double sum = 0;
  for (int s = 0; s < 2; s++) {
    orb_mesh_extent(&t->shape[s].mesh, &extent[s]);
  }
  for (int i = 0; i < ORB_FIND_SAMPLES; i++) {
    int32_t nearest = 0;
    double least = INFINITY;
    for (int32_t k = 0; k < map->count; k++) {
      double d = sqrt(orb_distance2(x + 3 * (size_t)t->sample[i], x + 3 * (size_t)map->first[k]));
      nearest = d < least ? k : nearest;
      least = fmin(d, least);
    }
    double away = sqrt(orb_distance2(one->image[i], y + 3 * (size_t)map->second[nearest]));
    sum += fmax(0, away / extent[1].diagonal - least / extent[0].diagonal) / ORB_FIND_SAMPLES;
  }
  return sum;
}

static int is_certain(const search *t) {
  return t->spectral.count > 0 && t->spectral.clear > ORB_FIND_CERTAIN;
}

/* Composes from a candidate's map: fills its energy, the images of the samples, and its cost. */
static orb_status run_candidate(search *t, candidate *one, orb_map_from from) {
  orb_sheet sheets[2];
  orb_status status;
  int held, improved;
  double energy[2], angle;
  memset(sheets, 0, sizeof sheets);
  one->energy = one->cost = INFINITY;
  ORB_GO(status, carry(t, one, sheets, &held), end);
  if (held) {
    ORB_GO(status,
           orb_compose(t->ctx, &sheets[0].shape, &sheets[1].shape, 1, 0, from, NULL, ORB_PRESET_DEFAULT, energy, &improved),
           end);
    one->energy = energy[1];
    ORB_GO(status, sample_images(t, sheets, one), end);
    ORB_GO(status, rotation_angle(t, one, &angle), end);
    one->cost = (one->energy - 1) * (1 + ORB_FIND_ROTATION_COST * angle);
    if (is_certain(t) && away_from_first(t, one) > ORB_FIND_AGREES) {
      one->energy = one->cost = INFINITY;
    }
  }
end:
  orb_sheet_free(t->ctx, &sheets[0]);
  orb_sheet_free(t->ctx, &sheets[1]);
  return status;
}

static orb_status list_rotations(search *t) {
  orb_aligned_shape shape[2];
  double rotation[9 * ORB_FIND_ROTATIONS];
  memset(shape, 0, sizeof shape);
  for (int s = 0; s < 2; s++) {
    shape[s].mesh = t->shape[s].mesh;
    shape[s].points = t->shape[s].points;
  }
  ORB_TRY(orb_rotation_candidates(t->ctx, &shape[0], &shape[1], ORB_FIND_ROTATIONS, rotation, &t->rotations));
  for (t->count = 0; t->count < t->rotations; t->count++) {
    memcpy(t->list[t->count].rotation, rotation + 9 * t->count, sizeof(double[9]));
    t->list[t->count].is_given = t->count == 0;
  }
  return ORB_OK;
}

/* Lists a tip map unless it is already listed. */
static void list_tip_map(search *t, const orb_tips tips[2], const orb_tip_map *map) {
  candidate one = {0};
  for (int32_t k = 0; k < tips[0].count; k++) {
    if (map->to[k] >= 0) {
      one.first[one.count] = tips[0].vertex[k];
      one.second[one.count++] = tips[1].vertex[map->to[k]];
    }
  }
  for (int32_t i = t->rotations; i < t->count; i++) {
    const candidate *other = &t->list[i];
    if (other->count == one.count && memcmp(other->first, one.first, sizeof one.first) == 0 &&
        memcmp(other->second, one.second, sizeof one.second) == 0) {
      return;
    }
  }
  t->list[t->count++] = one;
}

static orb_status list_tip_maps(search *t, const orb_tips tips[2]) {
  const orb_mesh *meshes[2] = {&t->shape[0].mesh, &t->shape[1].mesh};
  int32_t count, chosen_count, chosen[ORB_FIND_TIP_MAPS];
  orb_tip_map rotated[ORB_TIP_ROTATIONS], *maps = ORB_NEW(t->ctx, orb_tip_map, ORB_TIP_MAPS_MAX);
  orb_status status = ORB_E_NO_MEMORY;
  if (!maps) {
    return status;
  }
  ORB_GO(status, orb_tip_maps_by_rotation(t->ctx, meshes, tips, rotated, &count), end);
  for (int32_t i = 0; i < count; i++) {
    list_tip_map(t, tips, &rotated[i]);
  }
  orb_tip_maps(&tips[0], &tips[1], maps, &count);
  ORB_GO(status, orb_tip_maps_choose(t->ctx, meshes, tips, maps, count, ORB_FIND_TIP_MAPS, chosen, &chosen_count), end);
  for (int32_t i = 0; i < chosen_count; i++) {
    list_tip_map(t, tips, &maps[chosen[i]]);
  }
end:
  orb_free(t->ctx, maps);
  return status;
}

/* How far two tips are from being a pair of a spectral map: the sum of their distances from a pair, in diagonals. */
static double away_from_map(const search *t, const orb_spectral_candidate *map, int32_t first, int32_t second) {
  double least = INFINITY;
  for (int32_t i = 0; i < map->count; i++) {
    double sum = 0;
    for (int s = 0; s < 2; s++) {
      const double *x = t->shape[s].mesh.positions;
      orb_extent extent;
      orb_mesh_extent(&t->shape[s].mesh, &extent);
      sum += sqrt(orb_distance2(x + 3 * (size_t)(s ? second : first),
                                x + 3 * (size_t)(s ? map->second[i] : map->first[i]))) /
             extent.diagonal;
    }
    least = fmin(least, sum);
  }
  return least;
}

/* The tip map that is nearest to a spectral map: tips that are each other's nearest under it. */
static void list_tips_of_map(search *t, const orb_tips tips[2], const orb_spectral_candidate *map) {
  double away[ORB_TIPS_MAX][ORB_TIPS_MAX];
  orb_tip_map out = {0};
  for (int32_t i = 0; i < tips[0].count; i++) {
    for (int32_t k = 0; k < tips[1].count; k++) {
      away[i][k] = away_from_map(t, map, tips[0].vertex[i], tips[1].vertex[k]);
    }
  }
  for (int32_t i = 0; i < ORB_TIPS_MAX; i++) {
    out.to[i] = -1;
    for (int32_t k = 0; i < tips[0].count && k < tips[1].count; k++) {
      int is_pair = away[i][k] < ORB_FIND_BESIDE;
      for (int32_t j = 0; j < tips[0].count; j++) {
        is_pair = is_pair && away[j][k] >= away[i][k];
      }
      for (int32_t j = 0; j < tips[1].count; j++) {
        is_pair = is_pair && away[i][j] >= away[i][k];
      }
      if (is_pair && out.to[i] < 0) {
        out.to[i] = k;
        out.count++;
      }
    }
  }
  if (out.count >= 3) {
    list_tip_map(t, tips, &out);
  }
}

/* Maps from eigenfunctions: as tip maps, and by the places that they match. */
static orb_status list_spectral_maps(search *t, const orb_tips tips[2]) {
  ORB_TRY(orb_spectral_find(t->ctx, &t->shape[0].mesh, &t->shape[1].mesh, 0, &t->spectral));
  for (int32_t i = 0; i < t->spectral.count && i < ORB_FIND_SPECTRAL; i++) {
    const orb_spectral_candidate *map = &t->spectral.candidate[i];
    candidate one = {.count = map->count < ORB_TIPS_MAX ? map->count : ORB_TIPS_MAX, .is_near = 1};
    list_tips_of_map(t, tips, map);
    memcpy(one.first, map->first, (size_t)one.count * sizeof *one.first);
    memcpy(one.second, map->second, (size_t)one.count * sizeof *one.second);
    if (one.count >= 3) {
      t->list[t->count++] = one;
    }
  }
  return ORB_OK;
}

static double difference(const search *t, const candidate *x, const candidate *y) {
  orb_extent extent;
  double sum = 0;
  orb_mesh_extent(&t->shape[1].mesh, &extent);
  for (int i = 0; i < ORB_FIND_SAMPLES; i++) {
    sum += sqrt(orb_distance2(x->image[i], y->image[i])) / ORB_FIND_SAMPLES;
  }
  return sum / extent.diagonal;
}

/* Composes a candidate in full. If that is not certified or no better, the candidate stays as it is. */
static orb_status compose_candidate(search *t, candidate *one) {
  candidate before = *one;
  ORB_TRY(run_candidate(t, one, ORB_MAP_FROM_MAP));
  if (!(one->energy < before.energy)) {
    *one = before;
    one->is_stuck = 1;
  }
  return ORB_OK;
}

/* Moves the candidate of least cost to place `to`, among those that differ from all before it that composing improved.
 * 0: there is none. */
static int choose_next(search *t, int32_t to) {
  int32_t best = -1;
  for (int32_t i = to; i < t->count; i++) {
    int other = t->list[i].cost < INFINITY;
    for (int32_t k = 0; k < to && other; k++) {
      other = t->list[k].is_stuck || difference(t, &t->list[i], &t->list[k]) > ORB_FIND_DIFFERENT;
    }
    best = other && (best < 0 || t->list[i].cost < t->list[best].cost) ? i : best;
  }
  if (best >= 0) {
    candidate one = t->list[to];
    t->list[to] = t->list[best];
    t->list[best] = one;
  }
  return best >= 0;
}

static void add_pair(orb_candidate *out, int32_t first, int32_t second) {
  for (int32_t k = 0; k < out->count; k++) {
    if (out->first[k] == first || out->second[k] == second) {
      return;
    }
  }
  out->first[out->count] = first;
  out->second[out->count++] = second;
}

/* The pairs of the winner as vertices of the given meshes: its tips, or the first samples and their images. */
static orb_status write_pairs(const search *t, const candidate *winner, const orb_mesh *b, orb_candidate *out) {
  int exact = winner->count && !winner->is_near;
  for (int32_t k = 0; k < winner->count && exact; k++) {
    add_pair(out, t->shape[0].vertex[winner->first[k]], t->shape[1].vertex[winner->second[k]]);
  }
  if (exact) {
    return ORB_OK;
  }
  orb_nearest *tree;
  ORB_TRY(orb_nearest_create(t->ctx, b->positions, b->triangles, b->triangle_count, &tree));
  for (int i = 0; i < ORB_CANDIDATE_PAIRS; i++) {
    orb_place place;
    (void)orb_nearest_query(tree, winner->image[i], INFINITY, &place);
    add_pair(out, t->shape[0].vertex[t->sample[i]], orb_map_nearest_corner(b->triangles, &place));
  }
  orb_nearest_destroy(t->ctx, tree);
  return ORB_OK;
}

/* The candidate of least cost. *clear: how far the next one that differs is behind. */
static int32_t winner_of(const search *t, double *clear) {
  int32_t best = 0;
  double next = INFINITY;
  for (int32_t i = 0; i < t->count; i++) {
    best = t->list[i].cost < t->list[best].cost ? i : best;
  }
  for (int32_t i = 0; i < t->count; i++) {
    if (t->list[i].cost < next && difference(t, &t->list[best], &t->list[i]) > ORB_FIND_DIFFERENT) {
      next = t->list[i].cost;
    }
  }
  *clear = next < INFINITY ? fmax(0, 1 - t->list[best].cost / next) : 1;
  return best;
}

static orb_status run_all(search *t, const orb_mesh *b, orb_candidate *out) {
  orb_tips tips[2];
  ORB_TRY(list_rotations(t));
  for (int s = 0; s < 2; s++) {
    ORB_TRY(orb_tips_find(t->ctx, &t->shape[s].mesh, &tips[s]));
  }
  ORB_TRY(list_spectral_maps(t, tips));
  if (!is_certain(t)) {
    ORB_TRY(list_tip_maps(t, tips));
  }
  for (int32_t i = 0; i < t->count; i++) {
    ORB_TRY(run_candidate(t, &t->list[i], ORB_MAP_MAP_ONLY));
  }
  double given = t->list[0].cost;
  int32_t to = 0;
  for (; to < ORB_FIND_COMPOSED && choose_next(t, to); to++) {
    ORB_TRY(compose_candidate(t, &t->list[to]));
  }
  t->count = to;
  out->clear = 1;
  if (to == 0) {
    return ORB_OK;
  }
  const candidate *best = &t->list[winner_of(t, &out->clear)];
  out->energy = best->energy;
  out->is_certain = is_certain(t);
  return !best->is_given && best->cost < ORB_FIND_BETTER * given ? write_pairs(t, best, b, out) : ORB_OK;
}

orb_status orb_candidate_find(orb_context *ctx, const orb_mesh *a, const orb_mesh *b, orb_candidate *out) {
  orb_status status;
  search *t = ORB_NEW0(ctx, search, 1);
  memset(out, 0, sizeof *out);
  if (!t) {
    return ORB_E_NO_MEMORY;
  }
  t->ctx = ctx;
  ORB_GO(status, orb_coarse_copy_create(ctx, a, ORB_FIND_COARSE, &t->shape[0]), end);
  ORB_GO(status, orb_coarse_copy_create(ctx, b, ORB_FIND_COARSE, &t->shape[1]), end);
  ORB_GO(status,
         orb_map_spread(ctx, t->shape[0].mesh.positions, t->shape[0].mesh.vertex_count, ORB_FIND_SAMPLES, t->sample),
         end);
  status = run_all(t, b, out);
end:
  orb_coarse_copy_free(ctx, &t->shape[0]);
  orb_coarse_copy_free(ctx, &t->shape[1]);
  orb_free(ctx, t);
  return status;
}
