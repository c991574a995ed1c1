/* The spatial targets of a run and their places on the fixed shape, and the first level of a start. */
#include <math.h>
#include <string.h>

#include "align/map/engine/spread.h"
#include "align/map/starts/place.h"
#include "align/map/starts/registration.h"
#include "align/map/starts/smooth.h"
#include "base/check.h"
#include "base/loops.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/vec3.h"

typedef struct target_job {
  orb_map_run *c;
  orb_nearest *tree;
} target_job;

enum { SLICE = 1024 }; /* vertices between checks for cancellation: each may search the whole surface */

/* The fixed shape's vertex that is nearest to a target in position and normal. */
static orb_place nearest_with_normal(const orb_map_run *c, int32_t v) {
  const orb_map_surface *b = &c->b;
  int32_t best = 0, stride = 3 * (1 + b->triangle_count / c->params.place.search);
  double least = INFINITY;
  for (int32_t h = 0; h < 3 * b->triangle_count; h += stride) {
    int32_t u = b->triangles[h];
    double d =
        orb_distance2(b->x + 3 * (size_t)u, c->target + 3 * (size_t)v) +
        c->params.place.normal_weight * orb_distance2(b->normal + 3 * (size_t)u, c->target_normal + 3 * (size_t)v);
    if (d < least) {
      least = d;
      best = h;
    }
  }
  orb_place place = {.triangle = best / 3};
  place.at[best % 3] = 1;
  return place;
}

/* Finds the nearest point. If the surface faces another way there, a start that smooths doubts it; other starts take
 * the nearest vertex in position and normal instead, which may lie on another limb. */
static void find_target_places(void *arg, int64_t begin, int64_t end, int thread) {
  target_job *job = arg;
  orb_map_run *c = job->c;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    double n[3];
    (void)orb_nearest_query(job->tree, c->target + 3 * v, INFINITY, &c->target_place[v]);
    orb_map_surface_at(&c->b, &c->target_place[v], NULL, NULL, n);
    const int is_away = orb_dot(n, c->target_normal + 3 * v) < c->params.place.facing;
    c->doubted[v] = is_away && c->keeps_angles ? ORB_MAP_FACES_AWAY : ORB_MAP_TRUSTED;
    if (is_away && !c->keeps_angles) {
      c->target_place[v] = nearest_with_normal(c, (int32_t)v);
    }
  }
}

static int is_paired(const orb_map_run *c, int32_t moving) {
  int paired = 0;
  for (int32_t k = 0; k < c->pairs.count; k++) {
    paired |= c->pairs.moving[k] == moving;
  }
  return paired;
}

/* Computes where the given targets take vertex v, in the scale of the fixed shape. */
static void scaled_target(const orb_map_run *c, int32_t v, double out[3]) {
  for (size_t k = 0; k < 3; k++) {
    out[k] = (c->given_target[3 * (size_t)v + k] - c->b.centre[k]) * c->b.scale;
  }
}

/* Computes where a sample goes. */
static void sample_target(const orb_map_run *c, int32_t v, double out[3]) {
  orb_place place;
  if (c->samples_follow_target) {
    scaled_target(c, v, out);
    return;
  }
  orb_locate(c->b.locator, c->best + 3 * (size_t)v, -1, &place);
  orb_map_surface_at(&c->b, &place, out, NULL, NULL);
}

/* The pairs as anchors, and samples: of the best map or the given targets, or else by eigenfunctions. vertex and target
 * have room for all pairs and samples. */
static orb_status gather_anchors(orb_map_run *c, int samples, int32_t *vertex, double *target, orb_map_anchors *out) {
  *out = (orb_map_anchors){.vertex = vertex, .target = target};
  for (int32_t i = 0; i < c->pairs.count; i++) {
    memcpy(target + 3 * (size_t)i, c->b.x + 3 * (size_t)c->pairs.fixed[i], sizeof(double[3]));
    vertex[i] = c->pairs.moving[i];
  }
  out->count = out->exact = c->pairs.count;
  for (int32_t i = 0; samples == 0 && i < c->samples.count; i++) {
    if (!is_paired(c, c->samples.moving[i])) {
      memcpy(target + 3 * (size_t)out->count, c->b.x + 3 * (size_t)c->samples.fixed[i], sizeof(double[3]));
      vertex[out->count++] = c->samples.moving[i];
    }
  }
  samples = samples < c->vertex_count / 2 ? samples : c->vertex_count / 2;
  if (samples > 0) {
    ORB_TRY(orb_map_spread(c->ctx, c->x, c->vertex_count, samples, vertex + out->count));
  }
  for (int i = 0; i < samples; i++) {
    int32_t v = vertex[out->exact + i];
    if (!is_paired(c, v)) {
      sample_target(c, v, target + 3 * (size_t)out->count);
      vertex[out->count++] = v;
    }
  }
  return ORB_OK;
}

orb_status orb_map_register(orb_map_run *c, int samples) {
  orb_context *ctx = c->ctx;
  const orb_mesh *mesh = &c->moving->mesh;
  orb_map_anchors anchors;
  size_t most = (size_t)c->pairs.count + (size_t)(samples > 0 ? samples : c->samples.count);
  double fit, *target = ORB_NEW(ctx, double, 3 * most);
  int32_t *vertex = ORB_NEW(ctx, int32_t, most);
  target_job job = {.c = c};
  orb_status status = ORB_E_NO_MEMORY;
  c->has_usable = 0;
  if (!target || !vertex) {
    goto done;
  }
  if (c->given_target && samples == 0) {
    for (int32_t v = 0; v < c->vertex_count; v++) {
      scaled_target(c, v, c->target + 3 * (size_t)v);
    }
  } else {
    ORB_GO(status, gather_anchors(c, samples, vertex, target, &anchors), done);
    ORB_GO(
        status,
        orb_map_register_in_space(ctx, &c->params, &c->b, c->x, c->normal, c->vertex_count, &anchors, c->target, &fit),
        done);
  }
  orb_map_normals(c->target, c->vertex_count, mesh->triangles, mesh->triangle_count, c->target_normal);
  ORB_GO(status, orb_nearest_create(ctx, c->b.x, c->b.triangles, c->b.triangle_count, &job.tree), done);
  status = orb_sliced_by(ctx, c->vertex_count, SLICE, 64, find_target_places, &job);
  orb_nearest_destroy(ctx, job.tree);
done:
  orb_free(ctx, target);
  orb_free(ctx, vertex);
  return status;
}

typedef struct place_job {
  orb_map_run *c;
  orb_map_level *l;
  const int32_t *to_mesh;
  const double *points; /* NULL: spatial */
} place_job;

static void place_range(void *arg, int64_t begin, int64_t end, int thread) {
  place_job *job = arg;
  (void)thread;
  for (int64_t i = begin; i < end; i++) {
    int32_t v = job->to_mesh[job->l->vertex[i]];
    if (!job->points && !job->l->pinned[i]) {
      job->l->place[i] = job->c->target_place[v];
      orb_map_surface_at(&job->c->b, &job->l->place[i], NULL, job->l->x + 3 * i, NULL);
      orb_map_level_refresh(job->l, &job->c->b, (int32_t)i);
    } else {
      const double *points = job->points ? job->points : job->c->start;
      memcpy(job->l->x + 3 * i, points + 3 * (size_t)v, sizeof(double[3]));
      orb_map_level_locate(job->l, &job->c->b, (int32_t)i, -1);
    }
  }
}

/* Untangling cannot separate vertices that share a point: move them a little within their triangles. */
static void spread_out(orb_map_run *c, orb_map_level *l) {
  const double jitter = c->given_target ? c->params.place.given_jitter : c->params.place.jitter;
  uint64_t state = 0x9e3779b97f4a7c15u;
  for (int32_t v = 0; v < l->count; v++) {
    if (l->pinned[v]) {
      continue;
    }
    double w[3], sum = 0;
    for (int k = 0; k < 3; k++) {
      state = state * 6364136223846793005u + 1442695040888963407u;
      w[k] = l->place[v].at[k] + jitter * (double)(state >> 40) * 0x1p-24;
      sum += w[k];
    }
    for (int k = 0; k < 3; k++) {
      l->place[v].at[k] = w[k] / sum;
    }
    orb_map_surface_at(&c->b, &l->place[v], NULL, l->x + 3 * (size_t)v, NULL);
    orb_map_level_refresh(l, &c->b, v);
  }
}

orb_status orb_map_place(orb_map_run *c, orb_map_level *level, const int32_t *to_mesh, orb_map_start start) {
  const double *points = start == ORB_MAP_SPATIAL ? NULL : start == ORB_MAP_DRAWN ? c->best : c->start;
  place_job job = {c, level, to_mesh, points};
  orb_parallel_for(c->ctx, level->count, 16, place_range, &job);
  if (start == ORB_MAP_SPATIAL) {
    spread_out(c, level);
  }
  return start == ORB_MAP_SPATIAL && c->keeps_angles ? orb_map_smooth(c, level, to_mesh) : ORB_OK;
}
