/* The composed map.
 *
 * Embeddings that are each optimal by themselves do not correspond: what decides how a morph looks is the map from one
 * shape straight to the other. So the fixed shape's embedding is kept, and the moving one is decimated (its landmarks
 * stay) and refined anew, with every vertex holding a place on the fixed shape and moving there by Newton steps of the
 * composed symmetric Dirichlet energy (compose_step.c). At the first level of a thousand vertices or so all vertices
 * are put where a guess says; flips on the sphere are then allowed against a growing barrier until local untangling
 * clears them all, and from there on none is allowed again. There are two guesses: the shape bent onto the other in
 * space (compose_targets.c), which is good within a class, and the alignment as it was given, which always works. The
 * start of least energy wins, if it is better than the alignment as given.
 */
#include "align/compose.h"

#include <math.h>
#include <string.h>

#include "align/compose_level.h"
#include "base/check.h"
#include "embed/multires.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

enum {
  FIRST_LEVEL = 8000, /* vertices at which a start begins */
  LAST_START = 60000, /* and beyond which it gives up untangling */
  SOFT_ROUNDS = 8,
  SOFT_SWEEPS = 20,
  ROUGH_SWEEPS = 40,
  WORK = 600,   /* vertex steps a vertex, see composer.work */
  SAMPLES = 150 /* of a map, from which the moving shape is bent anew */
};

static const double GOOD_ENERGY = 1.2; /* below it the shapes correspond: no further start is tried */
static const double EPSILON = 0.1;
static const double STILL = 1e-3; /* of a mean edge: less does not count as moving */

typedef struct effort {
  double growth; /* of the vertices from level to level */
  int first_sweeps, coarse_sweeps, level_sweeps, final_sweeps;
} effort;

static effort effort_of(orb_preset preset) {
  return preset == ORB_PRESET_QUALITY ? (effort){1.3, 300, 120, 80, 120} : (effort){1.5, 150, 60, 40, 60};
}

typedef struct composer {
  orb_context *ctx;
  cm_surface b;
  orb_aligned_shape *moving;
  int32_t vertex_count, landmark_count;
  double *x, *normal; /* moving shape, area 4π */
  double *goal;       /* spatial targets; NULL: none */
  double *goal_normal;
  orb_place *goal_place; /* on the fixed shape, of every vertex of the moving one */
  unsigned char *keep;
  orb_hierarchy *hierarchy;
  double *position; /* x in the order of the surface */
  int32_t *local;
  orb_place *place; /* by vertex of the surface: where it was on the last level */
  double *best;     /* points of the best start, mesh order */
  double best_energy;
  int rough;    /* the alignment as given is only refined to be sampled */
  int passes;   /* bends through samples of the best map */
  int64_t work; /* vertex steps that may still be spent on clearing flips and further starts */
  effort effort;
} composer;

static void composer_free(composer *c) {
  orb_context *ctx = c->ctx;
  cm_surface_free(ctx, &c->b);
  orb_free(ctx, c->x);
  orb_free(ctx, c->normal);
  orb_free(ctx, c->goal);
  orb_free(ctx, c->goal_normal);
  orb_free(ctx, c->goal_place);
  orb_free(ctx, c->keep);
  orb_hierarchy_destroy(ctx, c->hierarchy);
  orb_free(ctx, c->position);
  orb_free(ctx, c->local);
  orb_free(ctx, c->place);
  orb_free(ctx, c->best);
}

static orb_status prepare(composer *c, const orb_aligned_shape *fixed) {
  orb_context *ctx = c->ctx;
  const orb_mesh *mesh = &c->moving->mesh;
  size_t n = (size_t)mesh->vertex_count;
  c->vertex_count = mesh->vertex_count;
  ORB_TRY(cm_surface_create(ctx, fixed, &c->b));
  c->x = ORB_NEW(ctx, double, 3 * n);
  c->normal = ORB_NEW(ctx, double, 3 * n);
  c->keep = ORB_NEW0(ctx, unsigned char, n);
  c->position = ORB_NEW(ctx, double, 3 * n);
  c->local = ORB_NEW(ctx, int32_t, n);
  c->place = ORB_NEW0(ctx, orb_place, n);
  c->best = ORB_NEW(ctx, double, 3 * n);
  c->goal = ORB_NEW(ctx, double, 3 * n);
  c->goal_normal = ORB_NEW(ctx, double, 3 * n);
  c->goal_place = ORB_NEW(ctx, orb_place, n);
  if (!c->x || !c->normal || !c->keep || !c->position || !c->local || !c->place || !c->best || !c->goal ||
      !c->goal_normal || !c->goal_place) {
    return ORB_E_NO_MEMORY;
  }
  orb_extent extent;
  orb_mesh_extent(mesh, &extent);
  double scale = extent.area > 0 ? sqrt(4 * M_PI / extent.area) : 1;
  for (size_t i = 0; i < 3 * n; i++) {
    c->x[i] = (mesh->positions[i] - 0.5 * extent.min[i % 3] - 0.5 * extent.max[i % 3]) * scale;
  }
  cm_normals(c->x, mesh->vertex_count, mesh->triangles, mesh->triangle_count, c->normal);
  for (int32_t i = 0; i < c->landmark_count; i++) {
    if (c->moving->landmark_vertices[i] >= 0) {
      c->keep[c->moving->landmark_vertices[i]] = 1;
    }
  }
  int32_t keep_until = c->landmark_count ? (4 * c->landmark_count > 300 ? 4 * c->landmark_count : 300) : 4;
  ORB_TRY(orb_hierarchy_create(ctx, mesh, c->keep, keep_until, &c->hierarchy));
  for (size_t v = 0; v < n; v++) {
    memcpy(c->position + 3 * v, c->x + 3 * (size_t)c->hierarchy->surface.to_mesh[v], sizeof(double[3]));
  }
  return ORB_OK;
}

typedef struct goal_job {
  composer *c;
  orb_nearest *tree;
} goal_job;

/* The fixed shape's vertex nearest to a target in position and normal. */
static orb_place nearest_with_normal(const composer *c, int32_t v) {
  const cm_surface *b = &c->b;
  int32_t best = 0, stride = 3 * (1 + b->triangle_count / 40000);
  double least = INFINITY;
  for (int32_t h = 0; h < 3 * b->triangle_count; h += stride) {
    int32_t u = b->triangles[h];
    double d = orb_distance2(b->x + 3 * (size_t)u, c->goal + 3 * (size_t)v) +
               0.25 * orb_distance2(b->normal + 3 * (size_t)u, c->goal_normal + 3 * (size_t)v);
    if (d < least) {
      least = d;
      best = h;
    }
  }
  orb_place place = {.triangle = best / 3};
  place.at[best % 3] = 1;
  return place;
}

/* The nearest point, if the surface faces the right way there; else the best compromise. */
static void find_goal_places(void *arg, int64_t begin, int64_t end, int thread) {
  goal_job *job = arg;
  composer *c = job->c;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    double n[3];
    (void)orb_nearest_query(job->tree, c->goal + 3 * v, INFINITY, &c->goal_place[v]);
    cm_surface_at(&c->b, &c->goal_place[v], NULL, NULL, n);
    if (orb_dot(n, c->goal_normal + 3 * v) < 0.5) {
      c->goal_place[v] = nearest_with_normal(c, (int32_t)v);
    }
  }
}

/* The landmarks as anchors, and, where a map is known already (c->best), samples of it. Arrays of the caller: room for
 * landmark_count + SAMPLES. */
static orb_status gather_anchors(composer *c, const orb_aligned_shape *fixed, int samples, int32_t *vertex,
                                 double *goal, cm_anchors *out) {
  *out = (cm_anchors){.vertex = vertex, .goal = goal};
  for (int32_t i = 0; i < c->landmark_count; i++) {
    int32_t u = fixed->landmark_vertices[i];
    if (c->moving->landmark_vertices[i] >= 0 && u >= 0) {
      memcpy(goal + 3 * (size_t)out->count, c->b.x + 3 * (size_t)u, sizeof(double[3]));
      vertex[out->count++] = c->moving->landmark_vertices[i];
    }
  }
  out->exact = out->count;
  samples = samples < c->vertex_count / 2 ? samples : c->vertex_count / 2;
  if (samples > 0) {
    ORB_TRY(cm_spread(c->ctx, c->x, c->vertex_count, samples, vertex + out->count));
  }
  for (int i = 0; i < samples; i++) {
    int32_t v = vertex[out->exact + i];
    if (!c->keep[v]) { /* a landmark is an anchor already */
      orb_place place;
      orb_locate(c->b.locator, c->best + 3 * (size_t)v, -1, &place);
      cm_surface_at(&c->b, &place, goal + 3 * (size_t)out->count, NULL, NULL);
      vertex[out->count++] = v;
    }
  }
  return ORB_OK;
}

/* Spatial targets, with the normals that the bent shape has, and the nearest places to them. */
static orb_status bend(composer *c, const orb_aligned_shape *fixed, int samples) {
  orb_context *ctx = c->ctx;
  const orb_mesh *mesh = &c->moving->mesh;
  cm_anchors anchors;
  double fit, *goal = ORB_NEW(ctx, double, 3 * ((size_t)c->landmark_count + SAMPLES));
  int32_t *vertex = ORB_NEW(ctx, int32_t, (size_t)c->landmark_count + SAMPLES);
  goal_job job = {.c = c};
  orb_status status = ORB_E_NO_MEMORY;
  if (!goal || !vertex) {
    goto done;
  }
  ORB_GO(status, gather_anchors(c, fixed, samples, vertex, goal, &anchors), done);
  ORB_GO(status, cm_spatial_targets(ctx, &c->b, c->x, c->normal, c->vertex_count, &anchors, c->goal, &fit), done);
  cm_normals(c->goal, c->vertex_count, mesh->triangles, mesh->triangle_count, c->goal_normal);
  ORB_GO(status, orb_nearest_create(ctx, c->b.x, c->b.triangles, c->b.triangle_count, &job.tree), done);
  orb_parallel_for(ctx, c->vertex_count, 64, find_goal_places, &job);
  orb_nearest_destroy(ctx, job.tree);
done:
  orb_free(ctx, goal);
  orb_free(ctx, vertex);
  return status;
}

typedef struct guess_job {
  composer *c;
  cm_level *l;
  const int32_t *to_mesh;
  int spatial;
} guess_job;

static void guess_range(void *arg, int64_t begin, int64_t end, int thread) {
  guess_job *job = arg;
  (void)thread;
  for (int64_t i = begin; i < end; i++) {
    int32_t v = job->to_mesh[job->l->vertex[i]];
    if (job->spatial && !job->l->pinned[i]) {
      job->l->place[i] = job->c->goal_place[v];
      cm_surface_at(&job->c->b, &job->l->place[i], NULL, job->l->x + 3 * i, NULL);
      cm_level_refresh(job->l, &job->c->b, (int32_t)i);
    } else {
      memcpy(job->l->x + 3 * i, job->c->moving->points + 3 * (size_t)v, sizeof(double[3]));
      cm_level_locate(job->l, &job->c->b, (int32_t)i, -1);
    }
  }
}

/* Vertices that share a point cannot be told apart by an untangling: spread them a little inside their places. */
static void spread_out(composer *c, cm_level *l) {
  uint64_t state = 0x9e3779b97f4a7c15u;
  for (int32_t v = 0; v < l->count; v++) {
    if (l->pinned[v]) {
      continue;
    }
    double w[3], sum = 0;
    for (int k = 0; k < 3; k++) {
      state = state * 6364136223846793005u + 1442695040888963407u;
      w[k] = l->place[v].at[k] + 0.3 * (double)(state >> 40) * 0x1p-24;
      sum += w[k];
    }
    for (int k = 0; k < 3; k++) {
      l->place[v].at[k] = w[k] / sum;
    }
    cm_surface_at(&c->b, &l->place[v], NULL, l->x + 3 * (size_t)v, NULL);
    cm_level_refresh(l, &c->b, v);
  }
}

static void relocate(composer *c, cm_level *l) {
  for (int32_t v = 0; v < l->count; v++) {
    if (!l->pinned[v]) {
      cm_level_locate(l, &c->b, v, l->place[v].triangle);
    }
  }
}

/* Sweeps until hardly a vertex moves any more. All vertices take part in the first one. */
static orb_status sweeps(composer *c, cm_level *l, cm_rules rules, int count) {
  double moved;
  int32_t stepped = l->count;
  rules.still = STILL * sqrt(4 * M_PI / l->triangle_count);
  for (int32_t v = 0; v < l->count; v++) {
    l->moved[v] = INFINITY;
  }
  for (int i = 0; i < count && stepped > l->count / 500; i++) {
    ORB_TRY(cm_level_sweep(c->ctx, l, &c->b, &rules, &moved, &stepped));
    c->work -= stepped;
  }
  return ORB_OK;
}

static void set_pull(const composer *c, cm_level *l, const int32_t *to_mesh, double strength) {
  for (int32_t v = 0; v < l->count; v++) {
    l->pull[v] = strength * l->area[v];
    if (strength > 0) {
      memcpy(l->goal + 3 * (size_t)v, c->goal + 3 * (size_t)to_mesh[l->vertex[v]], sizeof(double[3]));
    }
  }
}

/* Flips are driven out: sweeps against a growing barrier, then untangling of a copy, until that succeeds. */
static orb_status clear_flips(composer *c, cm_level *l, int rounds, int32_t *flips) {
  cm_rules rules = {.soft = 1, .barrier = 1e-4, .epsilon = EPSILON, .omega = 1};
  double *copy = ORB_NEW(c->ctx, double, 3 * (size_t)l->count);
  orb_status status = copy ? ORB_OK : ORB_E_NO_MEMORY;
  *flips = cm_level_flips(l);
  for (int round = 0; round < rounds && *flips && c->work > 0 && status == ORB_OK; round++) {
    ORB_GO(status, sweeps(c, l, rules, SOFT_SWEEPS), done);
    rules.barrier *= 3;
    *flips = cm_level_flips(l);
    if (*flips) {
      memcpy(copy, l->x, 3 * (size_t)l->count * sizeof *copy);
      ORB_GO(status, cm_level_untangle(c->ctx, l, flips, &c->work), done);
      if (*flips) {
        memcpy(l->x, copy, 3 * (size_t)l->count * sizeof *copy);
      } else {
        relocate(c, l);
      }
    }
  }
done:
  orb_free(c->ctx, copy);
  return status;
}

/* Writes a level back into the refiner and the places of its vertices. */
static void store_level(composer *c, const cm_level *l, orb_refiner *r) {
  for (int32_t v = 0; v < l->count; v++) {
    memcpy(r->point + 4 * (size_t)l->vertex[v], l->x + 3 * (size_t)v, sizeof(double[3]));
    c->place[l->vertex[v]] = l->place[v];
  }
}

/* A level of the vertices that live now, with the places of those that lived before; new ones are located. */
static orb_status load_level(composer *c, const orb_refiner *r, const unsigned char *known, cm_level *l) {
  ORB_TRY(cm_level_create(c->ctx, &c->hierarchy->surface, r->alive, r->pinned, c->position, r->live, c->local, l));
  int32_t hint = -1;
  for (int32_t v = 0; v < l->count; v++) {
    int32_t u = l->vertex[v];
    memcpy(l->x + 3 * (size_t)v, r->point + 4 * (size_t)u, sizeof(double[3]));
    if (known && known[u]) {
      l->place[v] = c->place[u];
      cm_level_refresh(l, &c->b, v);
    } else {
      cm_level_locate(l, &c->b, v, hint);
    }
    hint = l->place[v].triangle;
  }
  return ORB_OK;
}

/* What a level holds of its map, to go back to. */
typedef struct snapshot {
  orb_place *place;
  double *y; /* y, n and x, as they lie in the level */
} snapshot;

static orb_status snapshot_take(composer *c, const cm_level *l, snapshot *s) {
  s->place = ORB_NEW(c->ctx, orb_place, l->count);
  s->y = ORB_NEW(c->ctx, double, 9 * (size_t)l->count);
  if (!s->place || !s->y) {
    return ORB_E_NO_MEMORY;
  }
  memcpy(s->place, l->place, (size_t)l->count * sizeof *s->place);
  memcpy(s->y, l->y, 9 * (size_t)l->count * sizeof *s->y);
  return ORB_OK;
}

static void snapshot_restore(const snapshot *s, cm_level *l) {
  memcpy(l->place, s->place, (size_t)l->count * sizeof *s->place);
  memcpy(l->y, s->y, 9 * (size_t)l->count * sizeof *s->y);
}

/* Vertices that barriers have locked in get free where flips are allowed for a while. What comes of it is kept if it
 * can be untangled and is better. */
static orb_status loosen(composer *c, cm_level *l, int soft_sweeps, int hard_sweeps) {
  const cm_rules soft = {.soft = 1, .barrier = 1, .epsilon = EPSILON, .omega = 1},
                 hard = {.soft = 0, .barrier = 1, .epsilon = EPSILON, .omega = 1};
  snapshot before = {0};
  double energy = cm_level_energy(l);
  int32_t flips;
  orb_status status;
  ORB_GO(status, snapshot_take(c, l, &before), done);
  ORB_GO(status, sweeps(c, l, soft, soft_sweeps), done);
  ORB_GO(status, clear_flips(c, l, 3, &flips), done);
  if (!flips) {
    ORB_GO(status, sweeps(c, l, hard, hard_sweeps), done);
  }
  int worse = flips || cm_level_flips(l) || cm_level_energy(l) >= energy;
  if (worse) {
    snapshot_restore(&before, l);
  }
done:
  orb_free(c->ctx, before.place);
  orb_free(c->ctx, before.y);
  return status;
}

/* From a level without flips up to all vertices. rough: only so far that samples of the map are of use. */
static orb_status refine(composer *c, orb_refiner *r, cm_level *l, double pull, int rough, int *failed) {
  const int32_t *to_mesh = c->hierarchy->surface.to_mesh;
  const cm_rules hard = {.soft = 0, .barrier = 1, .epsilon = EPSILON, .omega = 1};
  unsigned char *known = ORB_NEW(c->ctx, unsigned char, c->vertex_count);
  orb_status status = known ? ORB_OK : ORB_E_NO_MEMORY;
  int first = 1;
  while (status == ORB_OK) {
    int last = r->live == c->vertex_count;
    set_pull(c, l, to_mesh, last ? 0 : pull);
    pull *= 0.5;
    int count = last             ? c->effort.final_sweeps
                : first          ? c->effort.first_sweeps
                : r->live < 3000 ? c->effort.coarse_sweeps
                                 : c->effort.level_sweeps;
    first = 0;
    if (rough) {
      ORB_GO(status, sweeps(c, l, hard, count < ROUGH_SWEEPS ? count : ROUGH_SWEEPS), done);
    } else {
      ORB_GO(status, sweeps(c, l, hard, count), done);
      ORB_GO(status, loosen(c, l, count / 2, count / 2), done);
    }
    *failed = cm_level_flips(l) > 0;
    if (*failed) {
      break;
    }
    store_level(c, l, r);
    if (last) {
      break;
    }
    memcpy(known, r->alive, (size_t)c->vertex_count);
    double target = c->effort.growth * r->live;
    target = target > c->vertex_count / 1.2 ? c->vertex_count : target;
    while (r->live < c->vertex_count && r->live < target) {
      ORB_GO(status, orb_refiner_undo_round(c->ctx, r, r->settings.blend), done);
    }
    cm_level_free(c->ctx, l);
    ORB_GO(status, load_level(c, r, known, l), done);
    for (int32_t v = 0; v < l->count; v++) {
      if (pull > 0) {
        (void)cm_level_try(l, &c->b, &hard, v, &c->goal_place[to_mesh[l->vertex[v]]]);
      }
      for (int i = 0; i < 3 && !known[l->vertex[v]]; i++) {
        cm_level_step(l, &c->b, &hard, v);
      }
    }
    orb_progress(c->ctx, "align", (double)r->live / c->vertex_count);
  }
done:
  orb_free(c->ctx, known);
  return status;
}

/* Runs one start; keeps its points if they are the best so far. */
static orb_status run_start(composer *c, int spatial) {
  orb_context *ctx = c->ctx;
  orb_embed_options options;
  orb_embed_defaults(&options);
  orb_refiner *r = NULL;
  cm_level level = {0};
  int32_t flips = 1;
  int failed = 0;
  orb_status status;
  ORB_GO(status, orb_refiner_create(ctx, c->hierarchy, &options, &r), done);
  r->settings.crowded = INFINITY;
  const int32_t *to_mesh = c->hierarchy->surface.to_mesh;
  for (int32_t want = FIRST_LEVEL; flips;) {
    ORB_GO(status, orb_refiner_advance(ctx, r, want < c->vertex_count ? want : c->vertex_count), done);
    for (int32_t v = 0; v < c->vertex_count; v++) {
      r->pinned[v] = c->keep[to_mesh[v]];
    }
    cm_level_free(ctx, &level);
    ORB_GO(status,
           cm_level_create(ctx, &c->hierarchy->surface, r->alive, r->pinned, c->position, r->live, c->local, &level),
           done);
    guess_job job = {c, &level, to_mesh, spatial};
    orb_parallel_for(ctx, level.count, 16, guess_range, &job);
    if (spatial) {
      spread_out(c, &level);
      set_pull(c, &level, to_mesh, 1);
    }
    ORB_GO(status, clear_flips(c, &level, SOFT_ROUNDS, &flips), done);
    if (flips && (r->live == c->vertex_count || r->live > LAST_START)) {
      goto done; /* this guess leads nowhere: not an error, the other one or the given alignment stays */
    }
    for (int32_t v = 0; v < c->vertex_count && flips; v++) {
      r->pinned[v] = 0;
    }
    want = r->live * 2;
  }
  store_level(c, &level, r);
  ORB_GO(status, refine(c, r, &level, spatial ? 0.5 : 0, !spatial && c->rough, &failed), done);
  if (!failed) {
    double energy = cm_level_energy(&level);
    if (energy < c->best_energy) {
      c->best_energy = energy;
      orb_refiner_points(r, c->best);
    }
  }
done:
  cm_level_free(ctx, &level);
  orb_refiner_destroy(ctx, r);
  return status;
}

/* The composed energy of the alignment as it was given. */
static orb_status given_energy(composer *c, double *energy) {
  orb_embed_options options;
  orb_embed_defaults(&options);
  const orb_mesh *mesh = &c->moving->mesh;
  orb_surface s;
  cm_level level = {0};
  ORB_TRY(orb_surface_create(c->ctx, mesh, &s));
  unsigned char *all = ORB_NEW(c->ctx, unsigned char, mesh->vertex_count);
  orb_status status = all ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    memset(all, 1, (size_t)mesh->vertex_count);
    status = cm_level_create(c->ctx, &s, all, all, c->position, mesh->vertex_count, c->local, &level);
  }
  if (status == ORB_OK) {
    int32_t hint = -1;
    for (int32_t v = 0; v < level.count; v++) {
      memcpy(level.x + 3 * (size_t)v, c->moving->points + 3 * (size_t)s.to_mesh[level.vertex[v]], sizeof(double[3]));
      cm_level_locate(&level, &c->b, v, hint);
      hint = level.place[v].triangle;
    }
    *energy = cm_level_energy(&level);
  }
  cm_level_free(c->ctx, &level);
  orb_free(c->ctx, all);
  orb_surface_free(c->ctx, &s);
  return status;
}

orb_status orb_compose(orb_context *ctx, const orb_aligned_shape *fixed, orb_aligned_shape *moving,
                       int32_t landmark_count, orb_preset preset, double energy[2], int *improved) {
  composer c = {.ctx = ctx, .moving = moving, .landmark_count = landmark_count, .effort = effort_of(preset)};
  c.passes = preset == ORB_PRESET_QUALITY ? 6 : 3;
  c.rough = preset != ORB_PRESET_QUALITY;
  c.work = (preset == ORB_PRESET_QUALITY ? 5000 : WORK) * (int64_t)moving->mesh.vertex_count;
  orb_certificate certificate;
  orb_status status;
  *improved = 0;
  ORB_GO(status, prepare(&c, fixed), done);
  ORB_GO(status, given_energy(&c, &energy[0]), done);
  energy[1] = c.best_energy = energy[0];
  memcpy(c.best, moving->points, 3 * (size_t)moving->mesh.vertex_count * sizeof *c.best);
  ORB_GO(status, bend(&c, fixed, 0), done);
  ORB_GO(status, run_start(&c, 1), done);
  if (preset == ORB_PRESET_QUALITY || c.best_energy > GOOD_ENERGY) {
    ORB_GO(status, run_start(&c, 0), done);
    double rough = c.best_energy;
    for (double last = INFINITY; c.best_energy < 0.99 * last && c.passes-- > 0 && c.work > 0;) {
      last = c.best_energy;
      ORB_GO(status, bend(&c, fixed, SAMPLES), done);
      ORB_GO(status, run_start(&c, 1), done);
    }
    if (c.rough && c.best_energy == rough) { /* nothing came of the samples */
      c.rough = 0;
      ORB_GO(status, run_start(&c, 0), done);
    }
  }
  if (c.best_energy < energy[0]) {
    ORB_GO(status,
           orb_certify(ctx, c.best, moving->mesh.vertex_count, moving->mesh.triangles, moving->mesh.triangle_count,
                       &certificate),
           done);
    if (certificate.valid) {
      memcpy(moving->points, c.best, 3 * (size_t)moving->mesh.vertex_count * sizeof *c.best);
      moving->certificate = certificate;
      energy[1] = c.best_energy;
      *improved = 1;
    }
  }
done:
  composer_free(&c);
  return status;
}
