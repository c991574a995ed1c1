/* The starts: each of the first five eigenfunctions after the constant one goes to one of the same five of the other
 * shape, as it is or negated. 14 orders of them, each with 32 choices of signs, make 448 maps. They are refined in
 * stages. After each stage, the best of those that differ continue. */
#include "spectral/spectral.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/loops.h"
#include "base/memory.h"
#include "base/tasks.h"
#include "spectral/cost.h"

enum { ORDERS = 14, SIGNS = 1 << (ORB_ZOOM_START - 1), STARTS = ORDERS * SIGNS };

/* Which function of the second shape each of the first five after the constant one goes to. Other proportions change
 * the order of eigenvalues that lie close together. */
static const int order_of_functions[ORDERS][ORB_ZOOM_START - 1] = {
    {1, 2, 3, 4, 5}, {2, 1, 3, 4, 5}, {1, 3, 2, 4, 5}, {1, 2, 4, 3, 5}, {1, 2, 3, 5, 4},
    {2, 1, 4, 3, 5}, {2, 1, 3, 5, 4}, {1, 3, 2, 5, 4}, {2, 3, 1, 4, 5}, {3, 1, 2, 4, 5},
    {1, 3, 4, 2, 5}, {1, 4, 2, 3, 5}, {1, 2, 4, 5, 3}, {1, 2, 5, 3, 4}};

/* Chosen by trial on the pairs of posed people with even numbers (tests/bench/correspond.py --half choose). */
enum { STAGES = 3 };
static const struct {
  int levels;   /* that the maps are refined to */
  int32_t kept; /* maps, of those that differ */
} stage[STAGES] = {{1, 80}, {4, 12}, {ORB_ZOOM_LEVELS, ORB_SPECTRAL_MAX}};
static const double SAME = 0.05;       /* mean distance of the images, √area being 1: maps nearer than this are one */
static const float APART = 0.03F;      /* pairs are at least this far apart, by the distances of samples */
static const double ROUND_TRIP = 0.12; /* a pair whose image comes back farther away is not listed */

typedef struct search {
  orb_context *ctx;
  const orb_spectral_shape *shape[2];
  orb_zoom_pair pair;
  int from, to; /* levels of the current loop */
  int32_t starts, count;
  int32_t order[STARTS];
  orb_zoom map[STARTS];
  orb_zoom_cost cost[STARTS];
} search;

static void refine(void *arg, int64_t begin, int64_t end, int thread) {
  search *s = arg;
  (void)thread;
  for (int64_t i = begin; i < end; i++) {
    int32_t at = s->order[i];
    orb_zoom_refine(&s->pair, s->from, s->to, &s->map[at]);
    orb_zoom_measure(&s->pair, &s->map[at], &s->cost[at]);
  }
}

static orb_status refine_all(search *s, int from, int to) {
  s->from = from;
  s->to = to;
  return orb_sliced_by(s->ctx, s->count, s->count, 1, refine, s);
}

/* Orders the maps by cost, best first, and keeps at most `most`; drops those that resemble a better one. */
static void keep_best(search *s, int32_t most) {
  for (int32_t i = 1; i < s->count; i++) {
    int32_t one = s->order[i], k = i;
    for (; k > 0 && s->cost[s->order[k - 1]].cost > s->cost[one].cost; k--) {
      s->order[k] = s->order[k - 1];
    }
    s->order[k] = one;
  }
  int32_t kept = 0;
  for (int32_t i = 0; i < s->count && kept < most; i++) {
    int is_new = 1;
    for (int32_t k = 0; k < kept && is_new; k++) {
      is_new = orb_zoom_difference(&s->pair, &s->map[s->order[i]], &s->map[s->order[k]]) > SAME;
    }
    if (is_new) {
      s->order[kept++] = s->order[i];
    }
  }
  s->count = kept;
}

/* A sample of one shape and the sample nearest to its image. */
typedef struct match {
  int32_t sample[2];
  int back;   /* sample[1] is the one that was taken to the other shape */
  float away; /* from the nearest pair listed so far, on the shape where that is less */
} match;

/* The samples of both shapes where the map and the map back agree. */
static int32_t gather(const search *s, const orb_zoom *map, match *out) {
  int32_t count = 0;
  for (int back = 0; back < 2; back++) {
    const int32_t *there = back ? map->back : map->forth, *again = back ? map->forth : map->back;
    for (int32_t i = 0; i < orb_spectral_samples(map->detail); i++) {
      if (s->shape[back]->distance[i * ORB_SPECTRAL_SAMPLES + again[there[i]]] < ROUND_TRIP) {
        out[count++] = (match){{back ? there[i] : i, back ? i : there[i]}, back, INFINITY};
      }
    }
  }
  return count;
}

static void add_pair(const search *s, const orb_zoom *map, const match *one, orb_spectral_candidate *out) {
  int own = one->back;
  int32_t *list[2] = {out->first, out->second};
  list[own][out->count] = s->shape[own]->sample[one->sample[own]];
  list[1 - own][out->count] = orb_zoom_image(&s->pair, map, one->sample[own], own);
  for (int32_t k = 0; k < out->count; k++) {
    if (list[0][k] == list[0][out->count] || list[1][k] == list[1][out->count]) {
      return;
    }
  }
  out->count++;
}

/* Takes pairs that are far from those before them, on both shapes. */
static void spread_pairs(const search *s, const orb_zoom *map, match *list, int32_t count,
                         orb_spectral_candidate *out) {
  int32_t next = 0;
  while (out->count < ORB_SPECTRAL_PAIRS && count > 0 && list[next].away > APART) {
    match one = list[next];
    add_pair(s, map, &one, out);
    for (int32_t i = 0; i < count; i++) {
      for (int k = 0; k < 2; k++) {
        float d = s->shape[k]->distance[one.sample[k] * ORB_SPECTRAL_SAMPLES + list[i].sample[k]];
        list[i].away = d < list[i].away ? d : list[i].away;
      }
      next = list[i].away > list[next].away ? i : next;
    }
  }
}

static void write_candidate(const search *s, int32_t at, orb_spectral_candidate *out) {
  const orb_zoom_cost *cost = &s->cost[at];
  match list[2 * ORB_SPECTRAL_SAMPLES];
  *out = (orb_spectral_candidate){
      .cost = cost->cost, .distortion = cost->distortion, .relief = cost->relief, .facing = cost->facing};
  spread_pairs(s, &s->map[at], list, gather(s, &s->map[at], list), out);
}

static orb_status run(search *s, orb_spectral_list *out) {
  ORB_TRY(orb_zoom_pair_create(s->ctx, s->shape[0], s->shape[1], &s->pair));
  for (s->count = 0; s->count < s->starts; s->count++) {
    s->order[s->count] = s->count;
    orb_zoom_start(order_of_functions[s->count / SIGNS], (uint32_t)s->count % SIGNS, &s->map[s->count]);
  }
  for (int i = 0; i < STAGES; i++) {
    ORB_TRY(refine_all(s, i ? stage[i - 1].levels : 0, stage[i].levels));
    keep_best(s, stage[i].kept);
  }
  for (int32_t i = 0; i < s->count; i++) {
    write_candidate(s, s->order[i], &out->candidate[out->count++]);
  }
  out->clear = out->count > 1 ? out->candidate[1].cost - out->candidate[0].cost : out->count;
  return ORB_OK;
}

typedef struct dense_job {
  const search *s;
  const orb_zoom *map;
  int32_t *out;
  int back;
} dense_job;

static void fill_dense(void *arg, int64_t begin, int64_t end, int thread) {
  dense_job *job = arg;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    job->out[v] = orb_zoom_vertex_image(&job->s->pair, job->map, (int32_t)v, job->back);
  }
}

static orb_status write_dense(search *s, int32_t most, orb_spectral_dense *out) {
  const size_t n[2] = {(size_t)s->shape[0]->mesh->vertex_count, (size_t)s->shape[1]->mesh->vertex_count};
  out->forth = ORB_NEW(s->ctx, int32_t, ORB_SPECTRAL_MAX * n[0]);
  out->back = ORB_NEW(s->ctx, int32_t, ORB_SPECTRAL_MAX * n[1]);
  if (!out->forth || !out->back) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < s->count && i < most; i++) {
    for (int back = 0; back < 2; back++) {
      dense_job job = {s, &s->map[s->order[i]], (back ? out->back : out->forth) + (size_t)i * n[back], back};
      ORB_TRY(orb_sliced_by(s->ctx, (int64_t)n[back], 4096, 64, fill_dense, &job));
    }
  }
  return ORB_OK;
}

/* Searches between usable shapes from the first `starts` starts. dense: NULL, or where maps take every vertex. */
static orb_status find(orb_context *ctx, const orb_spectral_shape *a, const orb_spectral_shape *b, int32_t starts,
                       int32_t most, orb_spectral_list *out, orb_spectral_dense *dense) {
  orb_status status;
  memset(out, 0, sizeof *out);
  if (!a->is_usable || !b->is_usable) {
    return ORB_OK;
  }
  search *s = ORB_NEW0(ctx, search, 1);
  if (!s) {
    return ORB_E_NO_MEMORY;
  }
  s->ctx = ctx;
  s->shape[0] = a;
  s->shape[1] = b;
  s->starts = starts;
  ORB_GO(status, run(s, out), end);
  if (dense) {
    out->count = out->count < most ? out->count : most;
    status = write_dense(s, most, dense);
  }
end:
  orb_zoom_pair_free(ctx, &s->pair);
  orb_free(ctx, s);
  return status;
}

typedef struct shape_job {
  orb_spectral_shape shape[2];
  const orb_mesh *mesh[2];
  int mirrored;
} shape_job;

static orb_status create_shape(orb_context *ctx, void *arg, int32_t i) {
  shape_job *job = arg;
  return orb_spectral_shape_create(ctx, job->mesh[i], i == 1 && job->mirrored, &job->shape[i]);
}

orb_status orb_spectral_find(orb_context *ctx, const orb_mesh *a, const orb_mesh *b, int mirrored,
                             orb_spectral_list *out) {
  orb_status status;
  shape_job *job = ORB_NEW0(ctx, shape_job, 1);
  memset(out, 0, sizeof *out);
  if (!job) {
    return ORB_E_NO_MEMORY;
  }
  job->mesh[0] = a;
  job->mesh[1] = b;
  job->mirrored = mirrored;
  ORB_GO(status, orb_tasks_run(ctx, 2, create_shape, job), end);
  status = find(ctx, &job->shape[0], &job->shape[1], STARTS, 0, out, NULL);
end:
  orb_spectral_shape_free(ctx, &job->shape[0]);
  orb_spectral_shape_free(ctx, &job->shape[1]);
  orb_free(ctx, job);
  return status;
}

orb_status orb_spectral_find_dense(orb_context *ctx, const orb_spectral_shape *a, const orb_spectral_shape *b,
                                   int32_t most, orb_spectral_list *out, orb_spectral_dense *dense) {
  *dense = (orb_spectral_dense){NULL, NULL};
  return find(ctx, a, b, STARTS, most, out, dense);
}

/* Each eigenfunction of a symmetric body is even or odd. So functions keep their order, and only signs are open. */
orb_status orb_spectral_find_mirror(orb_context *ctx, const orb_spectral_shape *shape, int32_t most,
                                    orb_spectral_list *out, orb_spectral_dense *dense) {
  orb_spectral_shape *mirrored = ORB_NEW(ctx, orb_spectral_shape, 1);
  *dense = (orb_spectral_dense){NULL, NULL};
  if (!mirrored) {
    return ORB_E_NO_MEMORY;
  }
  *mirrored = *shape;
  orb_spectral_shape_mirror(mirrored);
  const orb_status status = find(ctx, shape, mirrored, SIGNS, most, out, dense);
  orb_free(ctx, mirrored);
  return status;
}
