#include "align/find/inset/inset.h"

#include <math.h>
#include <string.h>

#include "align/find/inset/follow.h"
#include "align/find/trials.h"
#include "align/map/engine/spread.h"
#include "align/map/engine/surface.h"
#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "base/tasks.h"
#include "elastic/body.h"
#include "numeric/vec3.h"

/* One shape as a part of the other one. */
typedef struct search {
  const orb_trials *trials;
  int large; /* the shape that is the whole */
  const orb_mesh *part, *whole;
  const orb_nearest *tree[2]; /* of the part and of the whole */
  double *normal[2];          /* of their vertices */
  int32_t sample[ORB_FIND_INSET_SAMPLES], sample_count;
  orb_inset_grid grid; /* of the whole */
  orb_similarity at;   /* the best one */
  double score;        /* 0: there is none */
  unsigned char *fits; /* of each vertex of the part: lies on the whole */
  double share;        /* of them */
} search;

static orb_status search_create(orb_context *ctx, const orb_trials *t, search *c) {
  c->part = &t->copy[1 - c->large].mesh;
  c->whole = &t->copy[c->large].mesh;
  c->tree[0] = t->survey[1 - c->large].tree;
  c->tree[1] = t->survey[c->large].tree;
  const orb_mesh *mesh[2] = {c->part, c->whole};
  c->fits = ORB_NEW0(ctx, unsigned char, c->part->vertex_count);
  for (int k = 0; k < 2; k++) {
    c->normal[k] = ORB_NEW(ctx, double, 3 * (size_t)mesh[k]->vertex_count);
    if (!c->normal[k] || !c->fits) {
      return ORB_E_NO_MEMORY;
    }
    orb_map_normals(mesh[k]->positions, mesh[k]->vertex_count, mesh[k]->triangles, mesh[k]->triangle_count,
                    c->normal[k]);
  }
  const int32_t n = c->part->vertex_count;
  c->sample_count = n < ORB_FIND_INSET_SAMPLES ? n : ORB_FIND_INSET_SAMPLES;
  return orb_map_spread(ctx, c->part->positions, n, c->sample_count, c->sample);
}

static void search_free(orb_context *ctx, search *c) {
  orb_free(ctx, c->normal[0]);
  orb_free(ctx, c->normal[1]);
  orb_free(ctx, c->fits);
  orb_inset_grid_free(ctx, &c->grid);
}

/* Marks the vertices of the part that lie on the whole. */
static void mark_part(search *c) {
  int32_t count = 0;
  orb_place near = {.triangle = -1};
  for (int32_t v = 0; v < c->part->vertex_count; v++) {
    double p[3], at[3], own[3], other[3];
    orb_similarity_apply(&c->at, c->part->positions + 3 * (size_t)v, p);
    orb_rotate_point(c->at.rotation, c->normal[0] + 3 * (size_t)v, own);
    const double off = orb_inset_nearest(c->whole, c->tree[1], p, &near, at, other) / c->at.scale;
    c->fits[v] = off < ORB_FIND_INSET_NEAR && orb_dot(own, other) > ORB_FIND_INSET_FACING;
    count += c->fits[v];
  }
  c->share = (double)count / c->part->vertex_count;
}

/* Marks the vertices of the whole that the part covers. */
static void mark_whole(const search *c, unsigned char *covered) {
  orb_place near = {.triangle = -1};
  for (int32_t v = 0; v < c->whole->vertex_count; v++) {
    double p[3], at[3], own[3], other[3];
    orb_similarity_undo(&c->at, c->whole->positions + 3 * (size_t)v, p);
    const double off = orb_inset_nearest(c->part, c->tree[0], p, &near, at, other);
    orb_rotate_point(c->at.rotation, other, own);
    covered[v] = off < ORB_FIND_INSET_NEAR && orb_dot(own, c->normal[1] + 3 * (size_t)v) > ORB_FIND_INSET_FACING;
  }
}

/* The share of the whole's vertices that are uncovered and not in the largest piece of these. */
static orb_status measure_stray(orb_context *ctx, const search *c, double *share) {
  const int32_t n = c->whole->vertex_count;
  orb_body body = {0};
  int32_t open = 0, most = 0;
  orb_status status = ORB_E_NO_MEMORY;
  unsigned char *seen = ORB_NEW(ctx, unsigned char, n);
  int32_t *queue = ORB_NEW(ctx, int32_t, n);
  if (!seen || !queue) {
    goto end;
  }
  ORB_GO(status, orb_body_create(ctx, c->whole, &body), end);
  mark_whole(c, seen);
  for (int32_t v = 0; v < n; v++) {
    int32_t count = 0;
    if (!seen[v]) {
      queue[count++] = v;
      seen[v] = 1;
    }
    for (int32_t i = 0; i < count; i++) {
      for (int32_t e = body.start[queue[i]]; e < body.start[queue[i] + 1]; e++) {
        if (!seen[body.next[e]]) {
          seen[body.next[e]] = 1;
          queue[count++] = body.next[e];
        }
      }
    }
    open += count;
    most = count > most ? count : most;
  }
  *share = (double)(open - most) / n;
end:
  orb_body_free(ctx, &body);
  orb_free(ctx, seen);
  orb_free(ctx, queue);
  return status;
}

/* Soft landmarks exclude nothing, if there are enough others. */
static void set_landmarks(const orb_trials *t, int large, orb_inset_pair *out) {
  out->landmark_count = t->hint.trusted;
  out->landmark[0] = t->hint.at[1 - large];
  out->landmark[1] = t->hint.at[large];
}

int orb_inset_is_possible(const orb_trials *t) {
  int is_fixed = 0, fits = 0;
  for (int large = 0; large < 2; large++) {
    orb_inset_pair pair;
    orb_similarity at;
    set_landmarks(t, large, &pair);
    is_fixed = orb_inset_is_fixed(&pair);
    fits |= is_fixed && orb_inset_fit(&pair, &at);
  }
  return t->hint.trusted <= ORB_FIND_INSET_LANDMARKS && (fits || !is_fixed);
}

/* Where the part may lie if landmarks fix no similarity: anywhere, and where their middle meets. */
static orb_status write_starts(orb_context *ctx, const search *c, const orb_inset_pair *pair,
                               orb_similarity start[ORB_INSET_STARTS_MOST], int32_t *count) {
  const int32_t landmarks = pair->landmark_count;
  ORB_TRY(orb_inset_starts(ctx, &c->grid, pair->sample, start, count));
  double middle[2][3] = {{0}};
  for (int32_t i = 0; i < 6 * landmarks; i++) {
    middle[i & 1][i / 2 % 3] += pair->landmark[i & 1][i / 2] / landmarks;
  }
  if (landmarks > 0) {
    orb_inset_starts_at(middle[0], middle[1], start + *count);
    *count += ORB_INSET_STARTS;
  }
  return ORB_OK;
}

/* Is a copy neither a point nor endless? */
static int is_body(const orb_mesh *copy) {
  orb_extent extent;
  orb_mesh_extent(copy, &extent);
  return extent.diagonal > 0 && extent.diagonal < ORB_FIND_INSET_LONGEST;
}

static orb_status look(orb_context *ctx, void *arg, int32_t i) {
  search *c = (search *)arg + i;
  orb_inset_sample sample[ORB_FIND_INSET_SAMPLES];
  orb_similarity start[ORB_INSET_STARTS_MOST];
  double stray = 1;
  ORB_TRY(search_create(ctx, c->trials, c));
  if (c->sample_count < ORB_FIND_INSET_LOOKUPS || !is_body(c->part) || !is_body(c->whole)) {
    return ORB_OK;
  }
  for (int32_t k = 0; k < c->sample_count; k++) {
    memcpy(sample[k].position, c->part->positions + 3 * (size_t)c->sample[k], sizeof sample[k].position);
    memcpy(sample[k].normal, c->normal[0] + 3 * (size_t)c->sample[k], sizeof sample[k].normal);
  }
  orb_inset_pair pair = {
      .sample = sample, .sample_count = c->sample_count, .large = c->whole, .tree = c->tree[1], .grid = &c->grid};
  set_landmarks(c->trials, c->large, &pair);
  const int is_fixed = orb_inset_is_fixed(&pair);
  int32_t count = is_fixed && orb_inset_fit(&pair, start);
  if (is_fixed && count == 0) {
    return ORB_OK;
  }
  ORB_TRY(orb_inset_grid_create(ctx, c->whole, c->tree[1], &c->grid));
  if (!is_fixed) {
    ORB_TRY(write_starts(ctx, c, &pair, start, &count));
  }
  ORB_TRY(orb_inset_follow(ctx, &pair, start, count, &c->at, &c->score));
  if (!(c->score > 0) || c->at.scale < ORB_FIND_INSET_SMALLEST || c->at.scale > ORB_FIND_INSET_LARGEST) {
    return ORB_OK;
  }
  mark_part(c);
  if (c->share < ORB_FIND_INSET_SHARE) {
    c->share = 0;
    return ORB_OK;
  }
  ORB_TRY(measure_stray(ctx, c, &stray));
  c->share = stray > ORB_FIND_INSET_STRAY ? 0 : c->share;
  return ORB_OK;
}

/* Spreads pairs over what fits. Vertices of the shapes themselves are nearer to each other than those of copies. */
static orb_status write_pairs(orb_context *ctx, const search *c, orb_inset *out) {
  const orb_trials *t = c->trials;
  const orb_mesh *whole = t->mesh[c->large];
  const orb_trial_scaling *scaling = &t->scaling[c->large];
  const int32_t n = c->part->vertex_count;
  orb_nearest *tree = NULL;
  int32_t sample[ORB_FIND_INSET_PAIRS], count = 0;
  orb_status status = ORB_E_NO_MEMORY;
  int32_t *list = ORB_NEW(ctx, int32_t, n);
  double *x = ORB_NEW(ctx, double, 3 * (size_t)n);
  if (!list || !x) {
    goto end;
  }
  for (int32_t v = 0; v < n; v++) {
    if (c->fits[v]) {
      memcpy(x + 3 * (size_t)count, c->part->positions + 3 * (size_t)v, sizeof(double[3]));
      list[count++] = v;
    }
  }
  ORB_GO(status, orb_map_spread(ctx, x, count, ORB_FIND_INSET_PAIRS, sample), end);
  ORB_GO(status, orb_nearest_create(ctx, whole->positions, whole->triangles, whole->triangle_count, &tree), end);
  for (int32_t i = 0; i < ORB_FIND_INSET_PAIRS; i++) {
    double p[3];
    orb_place place;
    orb_similarity_apply(&c->at, x + 3 * (size_t)sample[i], p);
    for (int k = 0; k < 3; k++) {
      p[k] = p[k] / scaling->scale + scaling->middle[k];
    }
    (void)orb_nearest_query(tree, p, INFINITY, &place);
    const int32_t own = t->copy[1 - c->large].vertex[list[sample[i]]];
    const int32_t other = orb_map_nearest_corner(whole->triangles, &place);
    int is_new = 1;
    for (int32_t k = 0; k < out->count; k++) {
      is_new = is_new && out->vertex[1 - c->large][k] != own && out->vertex[c->large][k] != other;
    }
    if (is_new) {
      out->vertex[1 - c->large][out->count] = own;
      out->vertex[c->large][out->count++] = other;
    }
  }
end:
  orb_nearest_destroy(ctx, tree);
  orb_free(ctx, list);
  orb_free(ctx, x);
  return status;
}

orb_status orb_inset_find(const orb_trials *t, orb_inset *out) {
  search c[2] = {{.trials = t, .large = 0}, {.trials = t, .large = 1}};
  memset(out, 0, sizeof *out);
  orb_status status;
  ORB_GO(status, orb_tasks_run(t->ctx, 2, look, c), end);
  const search *best = c[1].share > c[0].share ? &c[1] : &c[0];
  if (best->share > 0) {
    status = write_pairs(t->ctx, best, out);
  }
end:
  search_free(t->ctx, &c[0]);
  search_free(t->ctx, &c[1]);
  return status;
}
